//! A measurement for people: tables for the terminal, CSV, and a page.

use super::record::{Cell as Figure, Record, Row};
use super::verdict::{Change, Comparison, Judgement};
use crate::report::bars::{Bar, BarGroup, Bars};
use crate::report::lines::{Axis, Line, Lines};
use crate::report::table::{Cell, Column, Table, Tone};
use crate::report::{Details, Report, Section, Verdict};
use std::path::Path;

/// Kernels: what their builds took.
pub fn kernels_table(r: &Record) -> Table {
    let mut table = Table::new([
        Column::text("kernel"),
        Column::text("build").help("how carefully: --build"),
        Column::number("seconds").help("to build; of several builds the median"),
        Column::number("MB").help("held beyond the geometry, millions of bytes"),
        Column::number("B/primitive").help("bytes held beyond the geometry, per primitive"),
    ]);
    let primitives = (r.scene.triangles + r.scene.procedurals).max(1) as f64;
    for (i, k) in r.kernels.iter().enumerate() {
        let (mb, each) = (k.memory as f64 * 1e-6, k.memory as f64 / primitives);
        table.push([
            Cell::from(r.kernel_label(i)),
            Cell::from(k.quality.as_str()).tone(Tone::Dim),
            Cell::number(k.build_seconds, format!("{:.3}", k.build_seconds)),
            Cell::number(mb, format!("{mb:.1}")),
            Cell::number(each, format!("{each:.1}")),
        ]);
    }
    table
}

/// Speed by row and workload: Mrays/s with the spread in percent.
pub fn speed_table(r: &Record) -> Table {
    let mut columns = vec![Column::text("kernel"), Column::text("form").help("how the kernel is called")];
    columns.extend(r.workloads.iter().map(|w| Column::number(&w.name).help(format!("Mrays/s: {}", w.doc))));
    columns.push(Column::number("x ref").help(format!(
        "geometric mean of the speeds over those of {}, where both have one",
        r.rows.get(r.reference).map_or(String::new(), |row| r.key(row))
    )));
    let mut table = Table::new(columns);
    for row in &r.rows {
        let mut cells = vec![Cell::from(r.kernel_label(row.kernel)), Cell::from(row.form.as_str())];
        cells.extend(row.cells.iter().map(|c| c.as_ref().map_or(Cell::none(), speed)));
        cells.push(r.mean_ratio(row).map_or(Cell::none(), |x| Cell::number(x, format!("{x:.2}"))));
        table.push(cells);
    }
    table
}

fn speed(c: &Figure) -> Cell {
    Cell::number(c.mrays, format!("{} ±{:.0}%", digits(c.mrays), 100.0 * c.spread() / c.mrays))
}

/// Three digits that count.
fn digits(v: f64) -> String {
    match v {
        v if v >= 100.0 => format!("{v:.0}"),
        v if v >= 10.0 => format!("{v:.1}"),
        v if v >= 0.1 => format!("{v:.2}"),
        _ => format!("{v:.4}"),
    }
}

/// Differences by row and workload: hit or miss, then primitive, against the reference and against the oracle.
pub fn agreement_table(r: &Record) -> Table {
    let mut columns = vec![Column::text("kernel"), Column::text("form")];
    columns.extend(r.workloads.iter().map(|w| {
        let rays = (w.rays, w.oracle_rays);
        Column::number(&w.name).help(format!(
            "answers of {} that differ from the reference row: hit or miss + other primitive; behind the bar those of {} \
             that differ from the oracle",
            rays.0, rays.1
        ))
    }));
    let mut table = Table::new(columns);
    for row in &r.rows {
        let mut cells = vec![Cell::from(r.kernel_label(row.kernel)), Cell::from(row.form.as_str())];
        cells.extend(row.cells.iter().map(|c| c.as_ref().map_or(Cell::none(), agreement)));
        table.push(cells);
    }
    table
}

fn agreement(c: &Figure) -> Cell {
    let d = c.differs;
    let oracle = c.oracle.map_or(String::new(), |o| format!(" | {}+{}", o.hit, o.primitive));
    let worst = d.total() + c.oracle.map_or(0, |o| o.total());
    let tone = match (d.hit + c.oracle.map_or(0, |o| o.hit), worst) {
        (0, 0) => Tone::Good,
        (0, _) => Tone::Plain,
        _ => Tone::Bad,
    };
    Cell::number(worst as f64, format!("{}+{}{oracle}", d.hit, d.primitive)).tone(tone)
}

/// What kernels that count did for a ray; empty if none counts.
pub fn visits_table(r: &Record) -> Table {
    let mut table = Table::new([
        Column::text("kernel"),
        Column::text("rays"),
        Column::number("nodes").help("inner nodes opened, per ray"),
        Column::number("leaves").help("leaves opened, per ray"),
        Column::number("primitives").help("primitives tested, per ray"),
    ]);
    let number = |x: f64| Cell::number(x, format!("{x:.2}"));
    for (k, kernel) in r.kernels.iter().enumerate() {
        if let Some([nodes, leaves, primitives]) = kernel.predicted {
            let what = Cell::from("predicted: lines that nothing stops");
            table.push([
                Cell::from(r.kernel_label(k)),
                what,
                number(nodes),
                number(leaves),
                number(primitives),
            ]);
        }
    }
    for v in &r.visits {
        let name = r.workloads[v.workload].name.as_str();
        table.push([
            Cell::from(r.kernel_label(v.kernel)),
            Cell::from(name),
            number(v.nodes),
            number(v.leaves),
            number(v.primitives),
        ]);
    }
    table
}

/// The whole of it for a terminal.
pub fn text(r: &Record) -> String {
    let mut out = heading(r) + "\n";
    let embree = [Some(&r.machine), r.peer.as_ref()].into_iter().flatten().filter_map(|m| m.embree.as_ref());
    embree.for_each(|e| out += &format!("Embree {}\n", e.describe()));
    out += &format!("\n{}\n", kernels_table(r).to_text());
    let speeds = "Mrays/s, median of the rounds ± their spread; x ref: geometric mean over the reference's";
    out += &speed_table(r).caption(speeds).to_text();
    let agree = "answers that differ from the reference's, hit or miss + other primitive | of a sample, from the oracle's";
    out += &format!("\n{}", agreement_table(r).caption(agree).to_text());
    if !r.visits.is_empty() {
        out +=
            &format!("\n{}", visits_table(r).caption("visits a ray, by the form for single rays").to_text());
    }
    out
}

fn heading(r: &Record) -> String {
    let rays = r.workloads.iter().map(|w| w.rays).max().unwrap_or(0);
    format!(
        "{}: {} triangles{}; {rays} rays of a kind, {} threads, {} rounds",
        r.scene.input,
        r.scene.triangles,
        if r.scene.procedurals > 0 {
            format!(", {} other primitives", r.scene.procedurals)
        } else {
            String::new()
        },
        r.threads,
        r.rounds
    )
}

/// One line a figure, with a line of names first.
pub fn csv(records: &[Record]) -> String {
    let mut out = String::from(
        "input,triangles,threads,kernel,backend,mode,simd,peer,build_seconds,kernel_bytes,form,workload,rays,mrays_median,\
         mrays_min,mrays_max,mrays_mad,ratio,differs_hit,differs_primitive,oracle_rays,oracle_hit,oracle_primitive\n",
    );
    for r in records {
        for row in &r.rows {
            for (w, cell) in r.workloads.iter().zip(&row.cells) {
                let Some(c) = cell else { continue };
                let k = &r.kernels[row.kernel];
                let number = |x: Option<u64>| x.map_or(String::new(), |x| x.to_string());
                let fields = [
                    quoted(&r.scene.input),
                    r.scene.triangles.to_string(),
                    r.threads.to_string(),
                    quoted(&k.name),
                    quoted(&k.backend),
                    k.mode.clone(),
                    k.simd.clone().unwrap_or_default(),
                    k.peer.to_string(),
                    k.build_seconds.to_string(),
                    k.memory.to_string(),
                    quoted(&row.form),
                    quoted(&w.name),
                    w.rays.to_string(),
                    c.mrays.to_string(),
                    c.min.to_string(),
                    c.max.to_string(),
                    c.mad.to_string(),
                    c.ratio.map_or(String::new(), |x| x.to_string()),
                    c.differs.hit.to_string(),
                    c.differs.primitive.to_string(),
                    w.oracle_rays.to_string(),
                    number(c.oracle.map(|o| o.hit)),
                    number(c.oracle.map(|o| o.primitive)),
                ];
                out += &(fields.join(",") + "\n");
            }
        }
    }
    out
}

/// As RFC 4180 wants fields with commas, quotes or line ends.
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

/// The page of a measurement.
pub fn page(r: &Record, comparison: Option<&Comparison>) -> Report {
    let name = Path::new(&r.scene.input).file_name().map_or("a scene".into(), |n| n.to_string_lossy());
    let mut report = Report::new(format!("Rays through {name}")).subtitle(heading(r));
    report = report.verdict(comparison.map_or_else(|| agreement_verdict(r), verdict));
    if let Some(c) = comparison {
        report = report.section(baseline_section(c));
    }
    let mut speed = Section::new("Speed").prose(
            "Each bar is the median of the rounds, its whisker runs from the slowest to the fastest. Rows ran in turn, \
             forwards and backwards, over exactly the same rays, which lay as each form wants them before the clock \
             started.",
        );
    for chart in (0..r.workloads.len()).filter_map(|w| bars(r, w)) {
        speed = speed.with(chart);
    }
    speed = speed.with(speed_table(r));
    let agreement = Section::new("Agreement")
        .prose(
            "Answers that differ from the reference row's: where one says hit and the other miss, plus where both name \
             another primitive (coincident surfaces do so by right). Behind the bar, within a sample of the rays, \
             differences from the oracle, which tests every primitive in double precision.",
        )
        .with(agreement_table(r));
    report = report.section(speed).section(agreement);
    report = report.section(Section::new("Kernels").with(kernels_table(r)));
    if !r.visits.is_empty() {
        report = report.section(Section::new("Visits").with(visits_table(r)));
    }
    let parts = r.workloads.iter().map(|w| {
        format!("{}: {} ({} rays, {:.1} % meet something)", w.name, w.doc, w.rays, 100.0 * w.hit_part)
    });
    report =
        report.section(Section::new("Rays").with(Details { open: true, ..Details::list("Kinds", parts) }));
    record_of(report, r)
}

fn record_of(report: Report, r: &Record) -> Report {
    let report = report.machine(&r.machine).fact("rays", r.rays.as_str());
    match &r.peer {
        None => report,
        Some(p) => {
            let embree = p.embree.as_ref().map_or("none".to_owned(), |e| e.describe());
            report.fact("peer", format!("skylit {}, commit {}; Embree {embree}", p.skylit, p.commit))
        }
    }
}

fn agreement_verdict(r: &Record) -> Verdict {
    let cells = || r.rows.iter().flat_map(|row| row.cells.iter().flatten());
    let hits: u64 = cells().map(|c| c.differs.hit).sum();
    let primitives: u64 = cells().map(|c| c.differs.primitive).sum();
    match hits + primitives {
        0 => Verdict::ok("All rows give the same answers to all rays."),
        _ => Verdict::neutral(format!(
            "Rows disagree with the reference in {hits} answers of hit or miss, and in {primitives} of which primitive."
        )),
    }
}

fn verdict(c: &Comparison) -> Verdict {
    if c.passed() { Verdict::ok(c.sentence()) } else { Verdict::bad(c.sentence()) }
}

/// Then and now; for the terminal as well.
pub fn baseline_table(changes: &[&Change]) -> Table {
    let mut table = Table::new([
        Column::text("row"),
        Column::text("rays"),
        Column::number("baseline").help("Mrays/s"),
        Column::number("now").help("Mrays/s"),
        Column::number("change"),
        Column::number("noise").help("three combined spreads, in percent of the baseline"),
        Column::text("verdict").help("beyond noise, and by 5 % at least"),
    ]);
    for c in changes {
        let (word, tone) = match c.judgement {
            Judgement::Slower => ("slower", Tone::Bad),
            Judgement::Faster => ("faster", Tone::Good),
            Judgement::Same => ("same", Tone::Dim),
        };
        let noise = 100.0 * c.noise / c.old;
        table.push([
            Cell::from(c.row.as_str()),
            Cell::from(c.workload.as_str()),
            Cell::number(c.old, digits(c.old)),
            Cell::number(c.new, digits(c.new)),
            Cell::number(c.percent(), format!("{:+.1} %", c.percent())),
            Cell::number(noise, format!("{noise:.1} %")),
            Cell::from(word).tone(tone),
        ]);
    }
    table
}

fn baseline_section(c: &Comparison) -> Section {
    let all: Vec<&Change> = c.changes.iter().collect();
    let mut section = Section::new("Against the baseline").with(baseline_table(&all));
    if !c.caveats.is_empty() {
        let list = Details::list("What else differs, so that figures mean less", c.caveats.clone());
        section = section.with(Details { open: true, ..list });
    }
    if !c.missing.is_empty() {
        section =
            section.with(Details::list("Rows of the baseline that were not measured", c.missing.clone()));
    }
    section
}

/// A chart for one workload; none where there are no rays.
fn bars(r: &Record, workload: usize) -> Option<Bars> {
    let info = &r.workloads[workload];
    let bar = |row: &Row| {
        let c = row.cells[workload].as_ref()?;
        Some(Bar {
            label: format!("{}, {}", r.kernel_label(row.kernel), row.form),
            value: c.mrays,
            text: digits(c.mrays),
            spread: Some([c.min, c.max]),
            series: row.kernel,
        })
    };
    let bars: Vec<Bar> = r.rows.iter().filter_map(bar).collect();
    let group = BarGroup { label: String::new(), bars };
    let chart = Bars {
        caption: format!("{}, Mrays/s: {}", info.name, info.doc),
        series: (0..r.kernels.len()).map(|k| r.kernel_label(k)).collect(),
        groups: vec![group],
    };
    (!chart.groups[0].bars.is_empty()).then_some(chart)
}

/// Build time, memory and speed by size, for a terminal.
pub fn growth_table(records: &[Record]) -> Table {
    let names = records.first().map(|r| r.workloads.iter().map(|w| w.name.clone()).collect::<Vec<_>>());
    let mut columns = vec![
        Column::number("triangles"),
        Column::text("kernel"),
        Column::text("form"),
        Column::number("build s"),
        Column::number("B/triangle"),
    ];
    columns.extend(names.unwrap_or_default().into_iter().map(|n| Column::number(n).help("Mrays/s")));
    let mut table = Table::new(columns);
    for r in records {
        let n = r.scene.triangles;
        for row in &r.rows {
            let k = &r.kernels[row.kernel];
            let each = k.memory as f64 / n.max(1) as f64;
            let mut cells = vec![
                Cell::number(n as f64, n.to_string()),
                Cell::from(r.kernel_label(row.kernel)),
                Cell::from(row.form.as_str()),
                Cell::number(k.build_seconds, format!("{:.3}", k.build_seconds)),
                Cell::number(each, format!("{each:.1}")),
            ];
            let speeds = row.cells.iter();
            cells.extend(
                speeds.map(|c| c.as_ref().map_or(Cell::none(), |c| Cell::number(c.mrays, digits(c.mrays)))),
            );
            table.push(cells);
        }
    }
    table
}

/// The page of a growth.
pub fn growth_page(records: &[Record]) -> Report {
    let Some(first) = records.first() else { return Report::new("Growth") };
    let subtitle = format!("{} in {} sizes, {} threads", first.scene.input, records.len(), first.threads);
    let of_kernels = |what: &str, y: &str, f: &dyn Fn(&Record, usize) -> f64| {
        let line = |k: usize| {
            let points = records.iter().map(|r| [r.scene.triangles as f64, f(r, k)]);
            Line { name: first.kernel_label(k), points: points.collect() }
        };
        lines(what, y, (0..first.kernels.len()).map(line).collect())
    };
    let build = of_kernels("Build time", "seconds", &|r, k| r.kernels[k].build_seconds);
    let memory = of_kernels("Memory beyond the geometry", "bytes per triangle", &|r, k| {
        r.kernels[k].memory as f64 / r.scene.triangles.max(1) as f64
    });
    let mut speed = Section::new("Speed").prose("The best form of each kernel, for each kind of rays.");
    for (w, info) in first.workloads.iter().enumerate() {
        let best = |r: &Record, k: usize| {
            let of_kernel = r.rows.iter().filter(|row| row.kernel == k);
            of_kernel.filter_map(|row| Some(row.cells[w].as_ref()?.mrays)).fold(0.0, f64::max)
        };
        let line = |k: usize| {
            let points = records.iter().map(|r| [r.scene.triangles as f64, best(r, k)]);
            Line { name: first.kernel_label(k), points: points.collect() }
        };
        let all = (0..first.kernels.len()).map(line).collect();
        speed = speed.with(lines(&format!("{}: {}", info.name, info.doc), "Mrays/s", all));
    }
    let report = Report::new("Growth with the number of triangles")
        .subtitle(subtitle)
        .section(Section::new("Build").with(build).with(memory))
        .section(speed)
        .section(Section::new("All figures").with(growth_table(records)));
    record_of(report, first)
}

fn lines(caption: &str, y: &str, series: Vec<Line>) -> Lines {
    let axis = |label: &str| Axis { label: label.into(), log: true };
    Lines { caption: caption.into(), x: axis("triangles"), y: axis(y), series }
}
