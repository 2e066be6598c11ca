//! `crosscheck --equivalent`, and the layer that tests for bias read.

use super::folder::Folder;

#[test]
fn kernels_are_equivalent() {
    let f = Folder::new();
    let kernels = if cfg!(feature = "bvh") { "bvh,brute" } else { "embree,brute" };
    let base = format!("crosscheck tri.ply --size 24x16 --backend {kernels} --equivalent 1%");
    let out = f.run(&format!("{base} --json c.json")).succeeds();
    assert!(
        out.stdout.contains("equivalent") && out.stdout.contains("common random numbers"),
        "{}",
        out.stdout
    );
    let record: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(f.path().join("c.json")).unwrap()).unwrap();
    let equal = &record["equivalence"];
    assert_eq!((equal["answer"].as_str(), equal["design"].as_str()), (Some("equivalent"), Some("paired")));
    assert!(equal["rounds"].as_u64() >= Some(1) && equal["spp"].as_u64() >= Some(4));
    // Seeds of their own and no samples to speak of: nobody knows.
    let poor = f.run(&format!("{base} --independent --budget 4"));
    assert_eq!(poor.code, 1);
    assert!(poor.stdout.contains("not enough samples"), "{}", poor.stdout);
    f.refuses("crosscheck tri.ply --budget 4", 2, &["--equivalent"]);
    f.refuses("crosscheck tri.ply --equivalent 200%", 2, &["--equivalent"]);
    f.refuses("crosscheck tri.ply --equivalent 1% --budget 0", 2, &["at least one sample"]);
    f.refuses("crosscheck tri.ply --equivalent 1% --backend brute", 2, &["at least two"]);
}

#[test]
fn halves_take_points_of_their_own() {
    let f = Folder::new();
    f.run("render tri.ply --size 8x6 --spp 4 --sky constant --threads 1 --aov halves -o a.exr").succeeds();
    let read = skylit::image::read::read_planes(&f.path().join("a.exr")).unwrap();
    let sampler = read.metadata.iter().find(|(k, _)| k == "sampler").map(|(_, v)| v.as_str());
    assert_eq!(sampler, Some("owen-sobol"));
    // A sky that is known to a thousandth would have no noise that says so: it is sampled, unless it is asked for.
    let same = |extra: &str| {
        let sky = "render tri.ply --size 16x12 --spp 64 --sky gradient --aov halves -o s.exr";
        f.run(&format!("{sky} {extra}")).succeeds();
        let read = skylit::image::read::read_planes(&f.path().join("s.exr")).unwrap();
        let [a, b, alpha] = ["halves.a.G", "halves.b.G", "A"].map(|n| &read.plane(n).unwrap().data);
        let bare = alpha.iter().zip(a.iter().zip(b)).filter(|(alpha, _)| **alpha == 0.0);
        let (same, apart): (Vec<_>, Vec<_>) = bare.partition(|(_, (a, b))| a == b);
        [same.len(), apart.len()]
    };
    let [none, all] = same("");
    assert!(none == 0 && all > 20, "{none} {all}");
    assert!(same("--sky-pixels integrate")[0] > 20);
    assert!(["halves.a.R", "halves.b.B", "halves.a.N", "halves.b.N"].iter().all(|n| read.plane(n).is_some()));
}
