//! `skylit crosscheck`: what it prints, writes and refuses.

use super::folder::Folder;

#[test]
fn it_tells_writes_and_asks_one_ray_again() {
    let f = Folder::new();
    let run = f.run("crosscheck scene.toml --spp 2 --json c.json --html c.html").succeeds();
    for word in ["kernel", "96 camera", "verdict  "] {
        assert!(run.stdout.contains(word), "{word} in {}", run.stdout);
    }
    assert_eq!(f.names(), ["c.html", "c.json", "scene.toml", "tri.ply"]);
    let record = f.json("c.json");
    assert_eq!(record["crosscheck"]["passed"], true);
    assert_eq!(record["crosscheck"]["camera_rays"], 8 * 6 * 2);
    assert!(record["machine"]["command"].as_str().is_some_and(|c| c.contains("crosscheck scene.toml")));
    let page = std::fs::read_to_string(f.path().join("c.html")).unwrap();
    assert!(page.contains("Crosscheck") && page.contains("data-viewer"));
    // Into the middle of the mesh, from where the camera is.
    let run = f.run("crosscheck scene.toml --ray -0.01,-0.01,1,0,0,-1,0,inf --backend brute").succeeds();
    for word in ["closest hit", "any hit", "brute", "oracle, of all primitives", "verdict"] {
        assert!(run.stdout.contains(word), "{word} in {}", run.stdout);
    }
    f.run("crosscheck tri.ply --size 8x6 --spp 1 --sky constant --integrator ao --quiet").succeeds();
}

#[test]
fn it_refuses_with_a_reason_and_leaves_nothing() {
    let f = Folder::new();
    f.refuses("crosscheck scene.toml --backend brute,nope", 2, &["unknown backend \"nope\"", "brute"]);
    f.refuses("crosscheck scene.toml --backend brute,brute", 2, &["twice"]);
    f.refuses("crosscheck scene.toml --integrator nope", 2, &["integrator"]);
    f.refuses("crosscheck none.toml --json c.json", 3, &["none.toml"]);
    f.refuses("crosscheck scene.toml --json no/c.json", 3, &["no/c.json"]);
    let before = f.listing();
    for bad in ["1,2,3", "0,0,1,0,0,0,0,inf", "0,0,1,0,0,-1,0,x"] {
        assert_eq!(f.run(&format!("crosscheck scene.toml --ray {bad}")).code, 2, "{bad}");
    }
    assert_eq!(f.listing(), before);
}
