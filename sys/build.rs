//! Finds Embree, compiles the shim and generates the bindings.
//!
//! Order of search: `EMBREE_DIR`; pkg-config; the compiler's own search path (where Debian and Ubuntu install) for
//! Embree 4, then 3. Tells dependents `DEP_EMBREE_VERSION`, and `DEP_EMBREE_LIBDIR` if the library lies outside of
//! the loader's search path and needs an rpath.

use std::env;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// An Embree that can be compiled against and linked.
struct Found {
    /// For the compiler's `-I`; empty if the header is on the default path.
    include: Option<PathBuf>,
    /// As it stands in an `#include`: `embree4/rtcore.h`.
    header: &'static str,
    /// For the linker's `-L`, and to be made an rpath; `None` if the library is on the default path.
    libdir: Option<PathBuf>,
    /// The linker's name: `embree4`, or `+verbatim` the name of a file.
    lib: String,
}

/// Headers and libraries by preference.
const HEADERS: [&str; 3] = ["embree4/rtcore.h", "embree3/rtcore.h", "rtcore.h"];

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            // `cargo::error` lines are shown by cargo as the error itself, without a backtrace of the build script.
            for line in e.to_string().lines() {
                println!("cargo::error={line}");
            }
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    for file in ["build.rs", "shim.h", "shim.c"] {
        println!("cargo::rerun-if-changed={file}");
    }
    for var in ["EMBREE_DIR", "LIBCLANG_PATH", "CPATH", "LIBRARY_PATH"] {
        println!("cargo::rerun-if-env-changed={var}");
    }
    let found = find()?;
    let version = version_of(&found)?;
    match &found.libdir {
        Some(dir) => {
            println!("cargo::rustc-link-search=native={}", dir.display());
            println!("cargo::metadata=libdir={}", dir.display());
            // Reaches this package's own tests; dependents act on `libdir` in their build script.
            println!("cargo::rustc-link-arg=-Wl,-rpath,{}", dir.display());
        }
        None => println!("cargo::metadata=libdir="),
    }
    println!("cargo::rustc-link-lib={}", found.lib);
    println!("cargo::metadata=version={version}");
    compile_shim(&found)?;
    generate_bindings(&found)
}

/// The first usable Embree in the order of search, or the one error that says what to do.
fn find() -> Result<Found, Box<dyn Error>> {
    if let Some(dir) = env::var_os("EMBREE_DIR").filter(|d| !d.is_empty()) {
        let dir = PathBuf::from(dir);
        return in_dir(&dir).ok_or_else(|| {
            format!(
                "EMBREE_DIR={} holds no Embree: expected include/embree4/rtcore.h (or embree3) and lib/libembree4.so \
                 (or lib64, or all flat). Correct it, or unset it to use the system's Embree.",
                dir.display()
            )
            .into()
        });
    }
    if !compiler_works() {
        return Err(
            "a C compiler is needed to build against Embree: run `./setup`, or install the package gcc \
                    (or clang), or set CC"
                .into(),
        );
    }
    by_pkg_config().or_else(on_default_path).ok_or_else(|| {
        "Intel Embree (4 or 3) was not found. Run `./setup`, or install the package libembree-dev (Debian, Ubuntu; \
         embree-devel on Fedora, embree on Arch and Homebrew), or set EMBREE_DIR to a folder with include/ and lib/. \
         To build skylit without it: --no-default-features."
            .into()
    })
}

/// An Embree below `dir`: `include/` and `lib/` or `lib64/`, or all flat.
fn in_dir(dir: &Path) -> Option<Found> {
    println!("cargo::rerun-if-changed={}", dir.display());
    // Absolute, because an rpath must be, and because rustc and build scripts run in different folders.
    let dir = dir.canonicalize().ok()?;
    for header in HEADERS {
        for include in [dir.join("include"), dir.clone()] {
            if !include.join(header).is_file() {
                continue;
            }
            for libdir in [dir.join("lib"), dir.join("lib64"), dir.join("lib/x86_64-linux-gnu"), dir.clone()]
            {
                if let Some(lib) = library_in(&libdir, header) {
                    let (include, libdir) = (Some(include), Some(libdir));
                    return Some(Found { include, header, libdir, lib });
                }
            }
        }
    }
    None
}

/// The linker's name of the library that belongs to `header`, if `libdir` has it.
fn library_in(libdir: &Path, header: &str) -> Option<String> {
    let names: &[&str] = match header {
        "embree4/rtcore.h" => &["embree4"],
        "embree3/rtcore.h" => &["embree3"],
        _ => &["embree4", "embree3", "embree"],
    };
    for name in names {
        if ["so", "dylib"].iter().any(|ext| libdir.join(format!("lib{name}.{ext}")).is_file()) {
            return Some((*name).to_owned());
        }
        for major in ["4", "3"] {
            let file = format!("lib{name}.so.{major}");
            if libdir.join(&file).is_file() {
                return Some(format!("dylib:+verbatim={file}"));
            }
        }
    }
    None
}

fn by_pkg_config() -> Option<Found> {
    for (package, lib) in [("embree4", "embree4"), ("embree3", "embree3"), ("embree", "embree")] {
        let Ok(library) = pkg_config::Config::new().cargo_metadata(false).probe(package) else { continue };
        let major = library.version.split('.').next().unwrap_or_default();
        let header = if major == "4" { HEADERS[0] } else { HEADERS[1] };
        return Some(Found {
            include: library.include_paths.first().cloned(),
            header,
            libdir: library.link_paths.first().cloned(),
            lib: library.libs.first().cloned().unwrap_or_else(|| lib.to_owned()),
        });
    }
    None
}

/// Debian and Ubuntu ship no `.pc` file: ask the compiler whether it finds the header, and where the library is.
fn on_default_path() -> Option<Found> {
    for (header, lib) in [(HEADERS[0], "embree4"), (HEADERS[1], "embree3")] {
        let found = Found { include: None, header, libdir: None, lib: lib.to_owned() };
        let file = if cfg!(target_os = "macos") { format!("lib{lib}.dylib") } else { format!("lib{lib}.so") };
        if version_of(&found).is_ok() && compiler_finds(&file) {
            return Some(found);
        }
    }
    None
}

fn compiler_works() -> bool {
    let Ok(compiler) = cc::Build::new().cargo_metadata(false).try_get_compiler() else { return false };
    Command::new(compiler.path()).arg("--version").output().is_ok_and(|o| o.status.success())
}

/// Whether the compiler's linker would find a library file. (GCC and Clang print the bare name if it would not.)
fn compiler_finds(file: &str) -> bool {
    let Ok(compiler) = cc::Build::new().cargo_metadata(false).try_get_compiler() else { return false };
    let output = Command::new(compiler.path()).arg(format!("-print-file-name={file}")).output();
    output.is_ok_and(|o| Path::new(String::from_utf8_lossy(&o.stdout).trim()).is_absolute())
}

/// Version by the header ("4.3.3"), read by running the preprocessor over it.
fn version_of(found: &Found) -> Result<String, Box<dyn Error>> {
    let probe = PathBuf::from(env::var("OUT_DIR")?).join("version.c");
    std::fs::write(&probe, format!("#include <{}>\nembree_version_is RTC_VERSION_STRING\n", found.header))?;
    let mut build = cc::Build::new();
    build.cargo_metadata(false).cargo_warnings(false).file(&probe);
    if let Some(include) = &found.include {
        build.include(include);
    }
    let text =
        build.try_expand().map_err(|e| format!("the C compiler cannot read <{}>: {e}", found.header))?;
    let text = String::from_utf8_lossy(&text);
    // The value stands on the last line; preprocessors put line markers in between.
    let version = text.trim().lines().next_back().unwrap_or_default().replace("embree_version_is", "");
    let version = version.trim().trim_matches('"');
    match version.split('.').next() {
        Some("3" | "4") => Ok(version.to_owned()),
        _ => Err(format!("Embree {version} is not supported; known: 3, 4").into()),
    }
}

fn compile_shim(found: &Found) -> Result<(), Box<dyn Error>> {
    let mut build = cc::Build::new();
    build.file("shim.c").std("c11").opt_level(2).define("EM_RTCORE_H", &*format!("<{}>", found.header));
    if let Some(include) = &found.include {
        build.include(include);
    }
    build.try_compile("embree_sys_shim").map_err(|e| format!("cannot compile sys/shim.c: {e}").into())
}

/// Only what the kernel needs; everything else of rtcore.h stays out.
fn generate_bindings(found: &Found) -> Result<(), Box<dyn Error>> {
    // bindgen panics where libclang is missing, with a hint that does not name the package.
    std::panic::set_hook(Box::new(|_| ()));
    let missing = "bindgen needs libclang: run `./setup`, or install the package libclang-dev (Debian, Ubuntu), or \
                   set LIBCLANG_PATH to the folder of libclang.so";
    let mut builder = bindgen::Builder::default()
        .header("shim.h")
        .clang_arg(format!("-DEM_RTCORE_H=<{}>", found.header))
        .allowlist_function(
            "em_.*|rtc(New|Release|Retain)(Device|Scene|Geometry)|rtcGetDevice(Error|Property)\
             |rtcSetDevice(ErrorFunction|MemoryMonitorFunction)|rtcCommit(Scene|Geometry)|rtcAttachGeometryByID\
             |rtcSetScene(BuildQuality|Flags)|rtcGetSceneBounds|rtcSetSharedGeometryBuffer\
             |rtcSetGeometry(BuildQuality|UserData|UserPrimitiveCount|BoundsFunction|IntersectFunction\
             |OccludedFunction|IntersectFilterFunction|OccludedFilterFunction|InstancedScene|Transform)",
        )
        .allowlist_type(
            "Em.*|RTC(Ray|Hit|RayHit)(4|8|16)?|RTCBounds|RTCError|RTCDeviceProperty|RTCSceneFlags|RTCBuildQuality\
             |RTCGeometryType|RTCBufferType|RTCFormat|RTC(Bounds|IntersectN|OccludedN|FilterN)?Function.*Arguments",
        )
        .allowlist_var("EM_.*")
        .prepend_enum_name(false)
        .generate_comments(false)
        .derive_default(false);
    if let Some(include) = &found.include {
        builder = builder.clang_arg(format!("-I{}", include.display()));
    }
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| builder.generate()));
    drop(std::panic::take_hook());
    let bindings = match result {
        Ok(result) => result.map_err(|e| format!("bindgen cannot read Embree's header: {e}"))?,
        Err(_) => return Err(missing.into()),
    };
    bindings.write_to_file(PathBuf::from(env::var("OUT_DIR")?).join("bindings.rs"))?;
    Ok(())
}
