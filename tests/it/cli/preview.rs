//! `--preview`, on a terminal of the test's own: a pseudo-terminal whose other end is read by the parser of a terminal
//! emulator. What its cells show is held against the picture that is written.

use super::folder::Folder;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use skylit::color::linear_to_srgb;
use skylit::image::read::read_planes;
use std::fs::{File, OpenOptions};
use std::io::Read;
use std::process::Child;
use std::time::Duration;

/// Rows and columns; room for a picture and the record below it.
const SIZE: [u16; 2] = [40, 60];

/// Both ends of a terminal.
fn terminal() -> (File, File) {
    let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&ours).unwrap();
    unlockpt(&ours).unwrap();
    let [ws_row, ws_col] = SIZE;
    tcsetwinsize(&ours, Winsize { ws_row, ws_col, ws_xpixel: ws_col * 8, ws_ypixel: ws_row * 16 }).unwrap();
    let name = ptsname(&ours, Vec::new()).unwrap().into_string().unwrap();
    let theirs = OpenOptions::new().read(true).write(true).open(name).unwrap();
    (ours.into(), theirs)
}

/// Starts a command whose stderr, and stdin if asked for, is a terminal.
fn start(f: &Folder, command: &str, colour: &str, with_stdin: bool) -> (Child, File) {
    let (ours, theirs) = terminal();
    let mut c = f.command(command);
    c.env("COLORTERM", colour).stderr(theirs.try_clone().unwrap());
    if with_stdin {
        c.stdin(theirs);
    } else {
        c.stdin(std::process::Stdio::null());
    }
    (c.spawn().unwrap(), ours)
}

/// All that is written to the terminal until nobody holds it any more.
fn read_all(mut ours: File) -> Vec<u8> {
    let (mut all, mut part) = (Vec::new(), [0; 4096]);
    // At its end a terminal is an error.
    while let Ok(n @ 1..) = ours.read(&mut part) {
        all.extend_from_slice(&part[..n]);
    }
    all
}

fn screen(bytes: &[u8]) -> vt100::Parser {
    let mut parser = vt100::Parser::new(SIZE[0], SIZE[1], 200);
    parser.process(bytes);
    parser
}

/// 40 x 30 pixels: 40 columns and 15 rows of two dots each.
const FLAGS: &str =
    "--size 40x30 --spp 4 --exposure 0.5 --tonemap agx --threads 2 --full-float -o a.exr -o a.png";

#[test]
fn cells_have_the_colours_of_the_picture() {
    for (colour, flags) in [("truecolor", ""), ("", ""), ("truecolor", "--spp 16 --dealing by-need")] {
        let f = Folder::new();
        let flags = if flags.is_empty() { FLAGS.to_owned() } else { FLAGS.replace("--spp 4", flags) };
        let (mut child, ours) =
            start(&f, &format!("render scene.toml --sky midday --preview=blocks {flags}"), colour, false);
        let bytes = read_all(ours);
        assert!(child.wait().unwrap().success(), "{}", String::from_utf8_lossy(&bytes));
        let parser = screen(&bytes);
        let shown = parser.screen();
        // It stands where the first of its rows is.
        let first = (0..SIZE[0]).find(|&y| is_picture(shown, y)).expect("a picture");
        let png = image_bytes(&f);
        for y in 0..15u16 {
            for x in 0..40u16 {
                let cell = shown.cell(first + y, x).unwrap();
                // Halves of one colour need no letter.
                let upper = match cell.contents() {
                    "\u{2580}" => cell.fgcolor(),
                    " " => cell.bgcolor(),
                    other => panic!("({x}, {y}) shows {other:?}"),
                };
                for (half, colour_of) in [(0, upper), (1, cell.bgcolor())] {
                    let expected = png[(2 * y + half) as usize][x as usize];
                    match colour_of {
                        vt100::Color::Rgb(r, g, b) => assert_eq!([r, g, b], expected, "({x}, {y}) {half}"),
                        vt100::Color::Idx(i) => assert!(
                            colour.is_empty() && far(expected, i) <= 40,
                            "({x}, {y}): {expected:?} {i}"
                        ),
                        vt100::Color::Default => panic!("({x}, {y}) has no colour"),
                    }
                }
            }
        }
        assert!(!shown.hide_cursor());
        let below = shown.contents();
        // The line of progress is gone, and the summary stands there.
        assert!(!below.lines().any(|l| l.starts_with("render ")) && below.contains("samples"), "{below}");
    }
}

/// Whether a row of the screen begins with a colour.
fn is_picture(shown: &vt100::Screen, row: u16) -> bool {
    shown.cell(row, 0).unwrap().bgcolor() != vt100::Color::Default
}

/// The written picture, row by row.
fn image_bytes(f: &Folder) -> Vec<Vec<[u8; 3]>> {
    let picture = read_planes(&f.path().join("a.png")).unwrap();
    let at =
        |name: &str, i: usize| (linear_to_srgb(picture.plane(name).unwrap().data[i]) * 255.0).round() as u8;
    let pixel = |i: usize| ["R", "G", "B"].map(|name| at(name, i));
    let row = |y: usize| (0..picture.width).map(|x| pixel(y * picture.width + x)).collect();
    (0..picture.height).map(row).collect()
}

/// Largest difference of a channel to a colour of the 256.
fn far(c: [u8; 3], index: u8) -> u8 {
    let level = |v: u8| [0, 95, 135, 175, 215, 255][usize::from(v)];
    let o = match index {
        232.. => [8 + 10 * (index - 232); 3],
        _ => [(index - 16) / 36, (index - 16) / 6 % 6, (index - 16) % 6].map(level),
    };
    (0..3).map(|i| c[i].abs_diff(o[i])).max().unwrap()
}

#[test]
fn large_pictures_fit_and_stay_in_place() {
    let f = Folder::new();
    let command =
        "render scene.toml --sky midday --preview=blocks --size 400x300 --time 1200ms --threads 1 -o a.png";
    let (mut child, ours) = start(&f, command, "truecolor", false);
    let bytes = read_all(ours);
    assert!(child.wait().unwrap().success());
    let text = String::from_utf8_lossy(&bytes);
    // Several pictures, of which one is seen, no wider and higher than the window.
    assert!(text.matches("\u{1b}[?2026h").count() >= 3, "{text}");
    assert!(text.contains("render ") && text.contains("Msamples/s"), "{text}");
    let parser = screen(&bytes);
    let shown = parser.screen();
    let rows = (0..SIZE[0]).filter(|y| is_picture(shown, *y)).count();
    // 59 of 60 columns, hence 44 rows of dots.
    assert_eq!(rows, 22);
    assert_eq!(shown.cell(0, SIZE[1] - 1).unwrap().contents(), "");
}

#[test]
fn an_interrupt_restores_the_terminal() {
    let f = Folder::new();
    let command =
        "render scene.toml --sky midday --preview=blocks --size 400x300 --time 60s --threads 1 -o a.png";
    let (mut child, ours) = start(&f, command, "truecolor", false);
    let reader = std::thread::spawn(move || read_all(ours));
    std::thread::sleep(Duration::from_millis(1500));
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let bytes = reader.join().unwrap();
    let text = String::from_utf8_lossy(&bytes);
    let (hide, show) = (text.rfind("\u{1b}[?25l"), text.rfind("\u{1b}[?25h"));
    assert!(hide.is_some() && show > hide, "{text}");
    assert!(text.contains("interrupted") && !screen(&bytes).screen().hide_cursor());
}

#[test]
fn sixels_come_where_they_are_asked_for() {
    let f = Folder::new();
    let command = "render scene.toml --sky midday --preview=sixel --size 40x30 --spp 4 -o a.png";
    let (mut child, ours) = start(&f, command, "truecolor", false);
    let bytes = read_all(ours);
    assert!(child.wait().unwrap().success());
    let text = String::from_utf8_lossy(&bytes);
    let (_, rest) = text.rsplit_once("\u{1b}P").expect("a picture by sixels");
    let (sixels, _) = rest.split_once("\u{1b}\\").expect("its end");
    // Raster attributes: 40 x 30 pixels.
    assert!(sixels.contains(";40;30"), "{sixels}");
    assert!(!screen(&bytes).screen().hide_cursor());
    // One that is not in the foreground of its terminal asks nothing, and draws blocks.
    let (mut child, ours) = start(&f, &command.replace("=sixel", ""), "truecolor", true);
    let bytes = read_all(ours);
    assert!(child.wait().unwrap().success());
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains("\u{1b}[48;2;") && !text.contains("\u{1b}[c"), "{text}");
}

#[test]
fn without_a_terminal_there_is_a_warning_and_a_picture() {
    let f = Folder::new();
    let run = f.run("render scene.toml --preview -o a.png").succeeds();
    assert_eq!(run.stderr.matches("warning").count(), 1, "{}", run.stderr);
    assert!(run.stderr.contains("--preview needs a terminal") && !run.stderr.contains('\u{1b}'));
    assert!(f.names().contains(&"a.png".into()));
    let run = f.run("render scene.toml --preview=ascii -o b.png");
    assert!(run.code == 2 && run.stderr.contains("blocks"), "{}", run.stderr);
}
