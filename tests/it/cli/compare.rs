//! `skylit compare`: figures of files, limits and exit codes, folders, and what cannot be compared.

use super::folder::Folder;
use serde_json::Value;

/// A scene's picture as `a.exr` and `a.png`, and with another seed as `b.exr` and `b.png`.
fn renders() -> Folder {
    let f = Folder::new();
    for (name, seed) in [("a", 0), ("b", 1)] {
        f.run(&format!(
            "render scene.toml -o {name}.exr -o {name}.png --seed {seed} --aov id,normal --full-float"
        ))
        .succeeds();
    }
    f
}

fn figure(record: &Value, metric: &str) -> Value {
    let figures = record["comparisons"][0]["figures"].as_array().unwrap();
    figures.iter().find(|f| f["metric"] == metric).unwrap().clone()
}

#[test]
fn two_renders_get_every_figure() {
    let f = renders();
    let run = f.run("compare a.exr b.exr --json out.json --csv out.csv --markdown out.md").succeeds();
    for word in ["bias", "RMSE", "PSNR", "linear", "worst region"] {
        assert!(run.stdout.contains(word), "{word}: {}", run.stdout);
    }
    let record = f.json("out.json");
    assert_eq!(record["comparisons"][0]["channels"], serde_json::json!(["R", "G", "B"]));
    let value = |m: &str| figure(&record, m)["value"].as_f64().unwrap();
    assert!((value("rmse").powi(2) - value("mse")).abs() < 1e-12 && value("mse") > 0.0);
    let csv = std::fs::read_to_string(f.path().join("out.csv")).unwrap();
    let line = csv.lines().find(|l| l.starts_with("a.exr,b.exr,mse,all,")).unwrap();
    assert_eq!(line.rsplit(',').next().unwrap().parse::<f64>().unwrap(), value("mse"));
    assert!(
        std::fs::read_to_string(f.path().join("out.md"))
            .unwrap()
            .starts_with("| metric | value | R | G | B |"),
        "{}",
        std::fs::read_to_string(f.path().join("out.md")).unwrap()
    );
    let alone = f.run("compare a.exr b.exr --metric rmse --csv -").succeeds();
    assert_eq!(alone.stdout.lines().count(), 5, "{}", alone.stdout);
}

#[test]
fn limits_decide_the_exit_code() {
    let f = renders();
    f.run("compare a.exr b.exr --fail-above relmse=1e9 --fail-below psnr=-100").succeeds();
    f.refuses("compare a.exr b.exr --fail-above relmse=1e-9", 1, &["b.exr: relmse", "is above 0.000000001"]);
    f.refuses("compare a.exr b.exr --fail-below psnr=300", 1, &["psnr", "is below 300"]);
    f.refuses("compare a.exr b.exr --fail-above psnr=30", 2, &["--fail-below psnr=30 is meant?"]);
    f.refuses("compare a.exr b.exr --fail-above rlmse=1", 2, &["did you mean \"relmse\"?"]);
    f.refuses("compare a.exr b.exr --fail-above relmse=much", 2, &["\"much\" is no number"]);
    // Taken for the limit alone, whatever else is asked for.
    f.refuses("compare a.exr b.exr --metric bias --fail-above mae=0", 1, &["mae"]);
}

#[test]
fn equal_pictures_are_said_to_be_equal() {
    let f = renders();
    let same = f.run("compare a.exr a.exr --fail-above mse=0 --fail-above bias=0").succeeds();
    assert!(same.stdout.contains("the same file") && same.stdout.contains("equal, to the last bit"));
    assert!(same.stdout.contains("inf"), "PSNR of equal pictures");
}

#[test]
fn kinds_may_be_mixed_and_parts_chosen() {
    let f = renders();
    let mixed = f.run("compare a.exr a.png --json - --metric bias,mae").succeeds();
    let record: Value = serde_json::from_str(&mixed.stdout).unwrap();
    // Half a step of 255 in the encoded value, and whatever is brighter than white.
    assert_eq!(record["comparisons"][0]["space"], "linear");
    let bytes = f.run("compare a.png b.png --json - --metric psnr").succeeds();
    let record: Value = serde_json::from_str(&bytes.stdout).unwrap();
    assert_eq!(record["comparisons"][0]["space"], "display");
    let normals = f.run("compare a.exr b.exr --layer normal --json -").succeeds();
    let record: Value = serde_json::from_str(&normals.stdout).unwrap();
    assert_eq!(record["comparisons"][0]["channels"], serde_json::json!(["X", "Y", "Z"]));
    assert!(figure(&record, "flip")["note"].as_str().unwrap().contains("colours"));
    let part = f.run("compare a.exr b.exr --crop 4x3+2+1 --json -").succeeds();
    let record: Value = serde_json::from_str(&part.stdout).unwrap();
    assert_eq!(record["comparisons"][0]["size"], serde_json::json!([4, 3]));
    let object = f.run("compare a.exr b.exr --object 1 --json - --metric mse").succeeds();
    let record: Value = serde_json::from_str(&object.stdout).unwrap();
    let pixels = record["comparisons"][0]["pixels"].as_u64().unwrap();
    assert!((1..48).contains(&pixels), "{pixels}");
    f.refuses("compare a.exr b.exr --object 77", 2, &["no pixel shows object 77"]);
    f.refuses("compare a.png b.png --object 1", 2, &["--aov id"]);
    f.refuses("compare a.exr b.exr --layer nrmal", 2, &["did you mean \"normal\"?"]);
    f.refuses("compare a.exr b.exr --channels R,Q", 2, &["no channel \"Q\"", "R"]);
    f.refuses("compare a.exr b.exr --crop 40x3+2+1", 2, &["--crop", "8x6"]);
}

#[test]
fn folders_are_compared_by_name() {
    let f = renders();
    for folder in ["one", "two"] {
        std::fs::create_dir(f.path().join(folder)).unwrap();
        std::fs::copy(f.path().join("a.exr"), f.path().join(format!("{folder}/x.exr"))).unwrap();
        std::fs::copy(f.path().join("b.png"), f.path().join(format!("{folder}/y.png"))).unwrap();
    }
    std::fs::copy(f.path().join("b.exr"), f.path().join("one/only.exr")).unwrap();
    std::fs::copy(f.path().join("b.exr"), f.path().join("two/z.exr")).unwrap();
    let run = f.run("compare one two --json out.json --metric mse,psnr").succeeds();
    assert!(run.stdout.contains("without a partner: one/only.exr"), "{}", run.stdout);
    let record = f.json("out.json");
    assert_eq!(record["comparisons"].as_array().unwrap().len(), 2);
    assert_eq!(record["alone"].as_array().unwrap().len(), 2);
    f.refuses("compare one two --fail-above mse=1", 1, &["one/only.exr has no partner"]);
    f.refuses("compare one a.exr", 2, &["the reference is a folder", "a.exr"]);
    f.refuses("compare a.exr one", 2, &["one is a folder"]);
    std::fs::create_dir(f.path().join("three")).unwrap();
    f.refuses("compare one three", 2, &["three: has no picture"]);
}

#[test]
fn what_cannot_be_compared_is_one_clear_line() {
    let f = renders();
    f.run("render scene.toml -o small.exr --size 4x3").succeeds();
    f.refuses("compare a.exr small.exr", 2, &["small.exr: is 4x3", "a.exr is 8x6", "0.500 times"]);
    f.refuses("compare a.exr nothing.exr", 3, &["nothing.exr", "open"]);
    let whole = std::fs::read(f.path().join("a.exr")).unwrap();
    f.write("cut.exr", &whole[..whole.len() / 2]);
    f.refuses("compare a.exr cut.exr", 2, &["cut.exr"]);
    f.write("empty.exr", b"");
    f.refuses("compare a.exr empty.exr", 2, &["empty.exr", "empty"]);
    f.refuses("compare a.exr", 2, &["TEST"]);
    f.refuses("compare a.exr b.exr --metric pnsr", 2, &["did you mean \"psnr\"?"]);
    f.refuses("compare a.exr b.exr --json no/where.json", 3, &["no/where.json"]);
}
