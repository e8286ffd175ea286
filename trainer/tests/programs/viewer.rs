//! The viewer in a real browser: it draws, counts what it draws, and asks the network for nothing. Skipped, with a word on
//! stderr, where no Chromium is installed; `CHROMIUM` names one that is not on the path.

use crate::drape::{SKIRT, TEE, drape};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn chromium() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome"].map(PathBuf::from);
    let answers =
        |name: &PathBuf| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success());
    named.into_iter().chain(names).find(answers)
}

fn browse(browser: &Path, page: &Path, state: &str, extra: &[&str]) -> String {
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
        // Whatever the page asks of the network is refused, and would be seen in the document.
        .args(["--host-resolver-rules=MAP * ~NOTFOUND", "--hide-scrollbars", "--window-size=900,700"])
        .args(["--virtual-time-budget=5000"])
        .args(extra)
        .arg(format!("file://{}#{state}", page.display()))
        .output()
        .unwrap();
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The value of a data attribute of the page's root.
fn data(document: &str, name: &str) -> String {
    let root =
        document.split_once("<html").map_or("", |(_, rest)| rest.split_once('>').map_or("", |(tag, _)| tag));
    let value = root.split_once(&format!("data-{name}=\"")).and_then(|(_, rest)| rest.split_once('"'));
    value.map_or(format!("no data-{name} in <html{root}>"), |(value, _)| value.to_owned())
}

#[test]
fn the_viewer_draws_every_layer_and_stage_in_chromium() {
    let Some(browser) = chromium() else {
        eprintln!("SKIPPED: no Chromium on the path, and CHROMIUM names none; the viewer was not opened");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    drape(&["--garments", SKIRT, TEE, "-o", &out.display().to_string()]).assert().success();
    let report: serde_json::Value =
        serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    let triangles = |value: &serde_json::Value| value["triangles"].as_u64().unwrap();
    let counts = [&report["body"], &report["garments"][0], &report["garments"][1]].map(triangles);

    let page = out.join("viewer.html");
    let see = |state: &str| browse(&browser, &page, state, &["--dump-dom"]);
    let whole = see("view=Back&colour=strain");
    assert_eq!((data(&whole, "state"), data(&whole, "colour")), ("ready".into(), "strain".into()));
    assert_eq!(data(&whole, "triangles"), counts.iter().sum::<u64>().to_string());
    assert_eq!(
        (data(&whole, "frame"), data(&whole, "frames")),
        ("3".into(), "4".into()),
        "the result is shown first"
    );
    let body = see("layers=0&frame=0&colour=gap");
    assert_eq!((data(&body, "state"), data(&body, "frame")), ("ready".into(), "0".into()));
    assert_eq!(data(&body, "triangles"), counts[0].to_string());

    let shot = folder.path().join("shot.png");
    browse(&browser, &page, "view=Front", &[&format!("--screenshot={}", shot.display())]);
    let picture = image::open(&shot).unwrap().to_rgb8();
    // The colours of both layers, teal and sand, in any light; neither is in the panel's half as often.
    let (mut teal, mut sand) = (0, 0);
    for (x, _, pixel) in picture.enumerate_pixels() {
        let [r, g, b] = pixel.0.map(i32::from);
        if x < picture.width() - 280 {
            teal += usize::from(b > r + 25 && g > r + 15);
            sand += usize::from(r > b + 30 && g > b + 20);
        }
    }
    assert!(teal > 2000 && sand > 2000, "{teal} teal and {sand} sand pixels");
}
