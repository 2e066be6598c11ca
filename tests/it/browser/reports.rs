//! The pages of every verb that writes one: whole, quiet, sortable, dark where that is asked for, and no wider than a phone.

use super::chromium::tab;
use super::tab::Tab;
use crate::cli::folder::Folder;

/// Small windows: of a desk and of a phone.
const DESK: [u32; 2] = [1200, 900];
const PHONE: [u32; 2] = [360, 740];

/// Runs commands, the last of which writes `page.html`, and looks at that.
#[track_caller]
fn look(commands: &[&str]) -> Option<(Folder, Tab)> {
    let mut tab = tab()?;
    let folder = Folder::new();
    for command in commands {
        folder.run(command).succeeds();
    }
    tab.open(&folder.path().join("page.html"));
    tab.eval("document.querySelectorAll('details').forEach((d) => (d.open = true))");
    tab.wait_for(
        "[...document.querySelectorAll('[data-viewer]')].every((v) => v.dataset.ready === 'true')",
        20.0,
    );
    Some((folder, tab))
}

/// What holds of any page.
#[track_caller]
fn examine(tab: &mut Tab) {
    tab.assert_clean();
    let pictures = "[...document.images].filter((i) => !(i.complete && i.naturalWidth > 0 && i.alt)).length";
    assert_eq!(tab.eval(pictures), 0, "pictures that are none");
    assert_charts(tab);
    assert_sorts(tab);
    assert_looks(tab);
    tab.assert_clean();
}

/// Charts have a size, and nothing of them leaves it.
#[track_caller]
fn assert_charts(tab: &mut Tab) {
    let bad = tab.eval(
        "[...document.querySelectorAll('svg')].filter((s) => {
          const b = s.getBoundingClientRect();
          const drawn = s.querySelector('polyline') || s.querySelector('rect');
          return !(b.width > 20 && b.height > 10 && drawn && s.getBBox().width <= b.width * 40);
        }).map((s) => s.outerHTML.slice(0, 300))",
    );
    assert_eq!(bad, serde_json::json!([]), "charts without a size");
    // Someone's longest bar fills its chart.
    let short = tab.eval(
        "[...document.querySelectorAll('.bars')].filter((b) => ![...b.querySelectorAll('svg')].some((s) => {
          const ends = [...s.querySelectorAll('rect, line')].map((e) => e.getBoundingClientRect().right);
          return Math.abs(Math.max(...ends) - s.getBoundingClientRect().right) < 2;
        })).length",
    );
    assert_eq!(short, 0, "charts of bars that none fills");
}

/// Defines `wrong(table, column, direction)`: what is out of order in a sorted table; numbers stand first, whichever way.
const WRONG: &str = "window.wrong = (table, column, direction) => {
  const told = [...table.tHead.rows[0].cells].map((h) => h.getAttribute('aria-sort'));
  if (told[column] !== direction || told.filter((t) => t).length !== 1) return [direction, ...told];
  const cells = [...table.tBodies[0].rows].map((r) => r.cells[column]);
  const numbers = cells.filter((c) => 'value' in c.dataset), values = numbers.map((c) => Number(c.dataset.value));
  if (!cells.slice(0, values.length).every((c) => numbers.includes(c))) return cells.map((c) => c.textContent);
  const sign = direction === 'ascending' ? 1 : -1;
  return values.filter((v, k) => k > 0 && sign * (v - values[k - 1]) < 0);
}";

/// Every column of every table sorts both ways: by the mouse, by the keyboard, and then all of them.
#[track_caller]
fn assert_sorts(tab: &mut Tab) {
    tab.eval(WRONG);
    let tables = tab.eval("[...document.querySelectorAll('table')].map((t, i) => (t.id = `t${i}`))");
    let nothing = serde_json::json!([]);
    for id in tables.as_array().into_iter().flatten().filter_map(|v| v.as_str()) {
        for (column, keys) in [(0, None), (1, Some(["Enter", " "]))] {
            let button = format!("#{id} th:nth-child({}) button", column + 1);
            for (i, direction) in ["ascending", "descending"].iter().enumerate() {
                match keys {
                    None => tab.click(&button),
                    Some(keys) => {
                        tab.eval(&format!("document.querySelector('{button}').focus()"));
                        tab.key(keys[i]);
                    }
                }
                let wrong = tab.eval(&format!("wrong({id}, {column}, '{direction}')"));
                assert_eq!(wrong, nothing, "{button}, {direction}");
            }
        }
        let wrong = tab.eval(&format!(
            "[...{id}.tHead.rows[0].cells].flatMap((h, column) => ['ascending', 'descending'].flatMap((direction) => {{
              if (h.getAttribute('aria-sort') === direction) return [];
              h.querySelector('button').click();
              return wrong({id}, column, direction);
            }}))"
        ));
        assert_eq!(wrong, nothing, "{id}");
    }
}

/// Dark where the system is, and on a phone no wider than its window.
#[track_caller]
fn assert_looks(tab: &mut Tab) {
    let light = tab.shot().at([4.0, 4.0]);
    tab.emulate(true, DESK[0], DESK[1], false);
    let dark = tab.shot().at([4.0, 4.0]);
    let sum = |c: [u8; 3]| c.map(u32::from).iter().sum::<u32>();
    assert!(sum(light) > 600 && sum(dark) < 150, "{light:?}, {dark:?}");
    for [width, height] in [PHONE, [DESK[0], DESK[1]], [PHONE[1], PHONE[0]]] {
        tab.emulate(false, width, height, width < 800);
        tab.settle();
        // A wider page would be laid out on a wider window.
        let wide = tab.eval(
            "[document.scrollingElement.scrollWidth, innerWidth, [...document.querySelectorAll('main *')].filter((e) =>
              e.getBoundingClientRect().right > document.documentElement.clientWidth + 1 && !e.closest('.scroll') && !e.closest('svg')).map((e) => e.outerHTML.slice(0, 120))]",
        );
        assert_eq!(wide[1], width, "{wide}");
        assert!(wide[0].as_u64() <= Some(width.into()), "{width}: {wide}");
        assert_eq!(wide[2], serde_json::json!([]), "{width}: what leaves the page");
    }
}

#[track_caller]
fn counts(tab: &mut Tab, selector: &str, least: u64) {
    let n = tab.eval(&format!("document.querySelectorAll('{selector}').length"));
    assert!(n.as_u64() >= Some(least), "{n} of {selector}, wanted {least}");
}

#[test]
fn of_crosscheck() {
    let Some((_folder, mut tab)) = look(&["crosscheck scene.toml --spp 2 --html page.html"]) else { return };
    counts(&mut tab, "img, [data-viewer]", 1);
    counts(&mut tab, "table", 1);
    examine(&mut tab);
}

#[test]
fn of_bench_rays() {
    let rays = "bench rays scene.toml --count 500 --rounds 2 --threads 1 --backend brute --form single,batch \
                --html page.html --quiet";
    let Some((_folder, mut tab)) = look(&[rays]) else { return };
    counts(&mut tab, ".bars svg rect", 4);
    examine(&mut tab);
}

#[test]
fn of_bench_error() {
    let error = "bench error scene.toml --size 24x16 --spp 2,4 --replicates 2 --reference-spp 64 \
                 -L sampler=owen-sobol,independent --html page.html";
    let Some((_folder, mut tab)) = look(&[error]) else { return };
    counts(&mut tab, "svg.lines polyline", 2);
    examine(&mut tab);
}

#[test]
fn of_check() {
    let Some((_folder, mut tab)) = look(&["check tri.ply --rays 300 --html page.html"]) else { return };
    counts(&mut tab, "table", 1);
    examine(&mut tab);
}

#[test]
fn of_compare() {
    let renders = [
        "render scene.toml -o a.exr --seed 0",
        "render scene.toml -o b.exr --seed 1",
        "render scene.toml -o c.exr --seed 2",
        "compare a.exr b.exr c.exr --html page.html",
    ];
    let Some((_folder, mut tab)) = look(&renders) else { return };
    counts(&mut tab, "[data-viewer]", 1);
    examine(&mut tab);
}
