//! `--pixel X,Y --explain`: what is printed, that it can be asked for again, and what is refused.

use super::folder::{Folder, SCENE};

/// The rest of the line that begins with a word.
fn line<'a>(text: &'a str, word: &str) -> &'a str {
    let found = text.lines().find_map(|l| l.strip_prefix(word));
    found.unwrap_or_else(|| panic!("no {word} in {text}")).trim()
}

/// A command as it is printed, without the program's name.
fn words(command: &str) -> &str {
    command.strip_prefix("skylit ").expect("a command")
}

#[test]
fn a_sample_is_told_and_the_lines_that_ask_again_work() {
    let f = Folder::new();
    let flags = "--spp 64 --dealing even --threads 2 --sky midday";
    let before = f.names();
    let run = f.run(&format!("render scene.toml {flags} --pixel 3,2 --explain --worst")).succeeds();
    assert_eq!(f.names(), before);
    for part in
        ["ray 0    from the camera", "meets tri, triangle", "material clay (diffuse)", "light sample of sky"]
    {
        assert!(run.stdout.contains(part), "{part}: {}", run.stdout);
    }
    assert!(line(&run.stdout, "sum").contains("bit for bit"), "{}", run.stdout);
    let again = line(&run.stdout, "again");
    assert!(again.contains("--sample ") && !again.contains("--worst"), "{again}");
    let replayed = f.run(words(again)).succeeds();
    assert_eq!(replayed.stdout, run.stdout);
    let ray = line(&run.stdout, "camera");
    assert!(ray.contains("--sky midday") && !ray.contains("--spp"), "{ray}");
    let answers = f.run(words(ray)).succeeds().stdout;
    assert!(answers.contains("closest hit") && answers.contains("tri, triangle"), "{answers}");
    // Any other ray of these, too.
    let shadow = run.stdout.lines().find_map(|l| l.trim().strip_prefix("shadow ray ")).expect("a shadow ray");
    f.run(&format!("crosscheck scene.toml --ray {shadow}")).succeeds();
}

#[test]
fn the_record_adds_up() {
    let f = Folder::new();
    f.write(
        "lit.toml",
        format!("{SCENE}\n[[lights]]\ntype = \"point\"\nposition = [0.3, 0.3, 2]\nintensity = 3\n"),
    );
    f.run("render lit.toml --spp 8 --pixel 3,2 --sample 5 --explain --stats e.json").succeeds();
    let e = f.json("e.json");
    assert_eq!((&e["pixel"], &e["sample"]), (&[3, 2].into(), &5.into()));
    assert_eq!(e["path"]["exact"], true);
    let channel = |v: &serde_json::Value, c: usize| v[c].as_f64().unwrap();
    for c in 0..3 {
        let mut sum = 0.0;
        for leg in e["path"]["legs"].as_array().unwrap() {
            let of = |list: &serde_json::Value| -> f64 {
                list.as_array().into_iter().flatten().map(|l| channel(&l["brings"], c)).sum()
            };
            sum += of(&leg["emitted"]) + of(&leg["surface"]["light_samples"]);
        }
        let radiance = channel(&e["radiance"], c);
        assert!((sum - radiance).abs() <= 1e-6 * (1.0 + radiance), "{c}: {sum} against {radiance}");
    }
    let lit = &e["path"]["legs"][0]["surface"]["light_samples"][0];
    assert!(
        lit["light"].as_str().unwrap().contains("(point)") || lit["light"].as_str().unwrap().contains("sky")
    );
}

#[test]
fn a_path_that_leaves_says_what_it_saw() {
    let f = Folder::new();
    let run = f.run("render scene.toml --pixel 0,0 --explain").succeeds();
    assert!(
        run.stdout.contains("leaves the scene") && run.stdout.contains("sky (constant) shows 1 1 1"),
        "{}",
        run.stdout
    );
    let run = f.run("render scene.toml --pixel 0,0 --explain --background transparent").succeeds();
    assert!(run.stdout.contains("brings nothing") && run.stdout.contains("alpha 0"), "{}", run.stdout);
    let run = f.run("render scene.toml --pixel 0,0 --explain --integrator normals").succeeds();
    assert!(run.stdout.contains("no more than its rays") && run.stdout.contains("nothing"), "{}", run.stdout);
}

#[test]
fn what_cannot_be_told_is_refused() {
    let f = Folder::new();
    f.refuses(
        "render scene.toml --pixel 8,0 --explain",
        2,
        &["pixel 8,0", "x from 0 to 7 and y from 0 to 5"],
    );
    f.refuses("render scene.toml --cropwindow 0.5,1,0,1 --pixel 3,0 --explain", 2, &["x from 4 to 7"]);
    f.refuses(
        "render scene.toml --dealing even --spp 4 --pixel 1,0 --sample 4 --explain",
        2,
        &["at most 4", "0 to 3"],
    );
    f.refuses("render scene.toml --time 1s --pixel 1,0 --worst --explain", 2, &["--spp"]);
    for (flags, word) in [
        ("--explain", "--pixel"),
        ("--pixel 1,1", "--explain"),
        ("--pixel 1 --explain", "X,Y"),
        ("--pixel a,1 --explain", "number"),
        ("--pixel -1,1 --explain", "-1"),
        ("--pixel 1,1 --explain --worst --sample 2", "--sample"),
    ] {
        let run = f.run(&format!("render scene.toml {flags}"));
        assert_eq!(run.code, 2, "{flags}");
        assert!(run.stderr.contains(word), "{flags}: {}", run.stderr);
    }
}
