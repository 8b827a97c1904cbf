//! Consistency of `deploy/` with the program, the scripts and each other. These tests need no container engine and no
//! cluster.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Out, bundled, root, skipped, write};
use serde_json::Value;

fn deploy(name: &str) -> PathBuf {
    root().join("deploy").join(name)
}

fn text(name: &str) -> String {
    fs::read_to_string(deploy(name)).unwrap()
}

fn yaml(text: &str) -> Value {
    serde_saphyr::from_str(text).unwrap()
}

fn words(list: &Value) -> Vec<String> {
    let words = list.as_array().unwrap().iter();
    words
        .map(|word| word.as_str().unwrap().to_owned())
        .collect()
}

/// The fleet's set and service.
fn kubernetes() -> [Value; 2] {
    let text = text("kubernetes/fleet.yaml");
    let (set, service) = text.split_once("\n---\n").unwrap();
    [yaml(set), yaml(service)]
}

/// Asserts that the program accepts these arguments.
fn is_command_line(arguments: &[String]) {
    let help = "--help".to_owned();
    let out = Out::answer(arguments.iter().chain([&help]));
    assert_eq!(out.code, 0, "{arguments:?}: {}", out.stderr);
    assert!(
        out.stdout.contains("Usage: tauscope "),
        "{arguments:?}: {} {}",
        out.stdout,
        out.stderr
    );
}

#[test]
fn every_command_line_is_one() {
    let compose = yaml(&text("container/compose.yaml"));
    for service in ["cell7", "fleet"] {
        is_command_line(&words(&compose["services"][service]["command"]));
    }
    let [set, _] = kubernetes();
    is_command_line(&words(
        &set["spec"]["template"]["spec"]["containers"][0]["args"],
    ));
    for (unit, expected) in [
        ("tauscope@.service", 2),
        ("tauscope-physics@.service", 1),
        ("tauscope-fleet.service", 1),
    ] {
        let unit = text(&format!("systemd/{unit}")).replace("$FLEET_OPTIONS", &fleet_options());
        let mut commands = 0;
        for line in unit.lines() {
            let Some(line) = line
                .strip_prefix("Exec")
                .and_then(|line| line.split_once('='))
            else {
                continue;
            };
            let mut command = line.1.split(' ').map(str::to_owned);
            assert_eq!(command.next().unwrap(), "/usr/bin/tauscope");
            is_command_line(&command.collect::<Vec<_>>());
            commands += 1;
        }
        assert_eq!(commands, expected, "{unit}");
    }
}

fn plants_page() -> String {
    fs::read_to_string(root().join("docs/plant.md")).unwrap()
}

/// Options that the plant's page writes into the file of the fleet's unit, with lines joined as by systemd.
fn fleet_options() -> String {
    let page = plants_page();
    let (_, rest) = page.split_once("FLEET_OPTIONS=\"").unwrap();
    let (options, _) = rest.split_once('"').unwrap();
    let options = options.replace("\\\n", "");
    assert!(options.contains("--connect tls/") && options.contains("--expect "));
    options
}

/// A pipeline whose file names no hosts refuses `--host`.
#[test]
fn the_unit_runs_the_pipeline_of_the_plants_page() {
    let page = plants_page();
    let (_, rest) = page.split_once("```yaml\n").unwrap();
    let (plant, _) = rest.split_once("```").unwrap();
    let unit = text("systemd/tauscope@.service");
    let run = unit.lines().find(|line| line.starts_with("ExecStart="));
    assert!(!plant.contains("hosts:") && !run.unwrap().contains("--host"));
}

#[test]
fn the_package_brings_every_unit() {
    let package = text("package.sh");
    for entry in fs::read_dir(deploy("systemd")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(
            package.contains(&format!("deploy/systemd/{name}")),
            "{name}"
        );
    }
}

/// Text after `tls/host:`.
fn tls_port(text: &str) -> Vec<&str> {
    let mut ports: Vec<&str> = (text.split("tls/").skip(1))
        .map(|rest| {
            let port = rest.split_once(':').unwrap().1;
            &port[..port.find(|c: char| !c.is_ascii_digit()).unwrap()]
        })
        .collect();
    ports.dedup();
    ports
}

#[test]
fn every_port_is_the_one_that_is_listened_on() {
    let router = text("zenoh/secure.sh");
    assert_eq!(tls_port(&router), ["7448"]);
    for name in [
        "container/compose.yaml",
        "container/cell7.yaml",
        "kubernetes/fleet.yaml",
    ] {
        assert_eq!(tls_port(&text(name)), ["7448"], "{name}");
    }
    let compose = yaml(&text("container/compose.yaml"));
    let services = &compose["services"];
    assert_eq!(words(&services["router"]["ports"]), ["7448:7448"]);
    assert_eq!(words(&services["fleet"]["ports"]), ["127.0.0.1:7460:7460"]);
    let serve = "--serve=0.0.0.0:7460".to_owned();
    assert!(words(&services["fleet"]["command"]).contains(&serve));

    let [set, service] = kubernetes();
    let container = &set["spec"]["template"]["spec"]["containers"][0];
    assert!(words(&container["args"]).contains(&serve));
    assert_eq!(container["ports"][0]["containerPort"], 7460);
    let name = &container["ports"][0]["name"];
    assert_eq!(&service["spec"]["ports"][0]["targetPort"], name);
    let routes = fs::read_to_string(root().join("fleet/src/web.rs")).unwrap();
    for probe in ["startupProbe", "livenessProbe", "readinessProbe"] {
        let get = &container[probe]["httpGet"];
        assert_eq!(&get["port"], name);
        let route = format!(".route(\"{}\"", get["path"].as_str().unwrap());
        assert!(routes.contains(&route), "{route}");
    }
    assert_eq!(
        service["spec"]["selector"],
        set["spec"]["template"]["metadata"]["labels"]
    );
}

#[test]
fn every_file_that_is_mounted_is_there_or_made() {
    if Command::new("openssl").arg("version").output().is_err() {
        skipped(
            "every_file_that_is_mounted_is_there_or_made",
            "openssl is absent",
        );
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let made = Command::new(deploy("zenoh/secure.sh"))
        .arg(folder.path().join("secure"))
        .args(["router", "cell7"])
        .output()
        .unwrap();
    assert!(made.status.success(), "{made:?}");
    for name in ["cell7.yaml", "compose.yaml"] {
        fs::copy(deploy("container").join(name), folder.path().join(name)).unwrap();
    }
    // Files of the plant.
    fs::copy(
        bundled().join("demo_arm.urdf"),
        folder.path().join("robot.urdf"),
    )
    .unwrap();

    let compose = yaml(&text("container/compose.yaml"));
    let mut endpoints = text("container/cell7.yaml");
    for (name, service) in compose["services"].as_object().unwrap() {
        let mut inside = Vec::new();
        for volume in words(&service["volumes"]) {
            let mut parts = volume.split(':');
            let (from, to) = (parts.next().unwrap(), parts.next().unwrap());
            if from.starts_with("./") {
                assert!(folder.path().join(from).exists(), "{name}: {from}");
                inside.push(to.to_owned());
            } else {
                assert!(compose["volumes"].get(from).is_some(), "{name}: {from}");
            }
        }
        endpoints += &words(&service["command"]).join("\n");
        // Every path in the command of this service is mounted.
        let command = words(&service["command"]).join(" ");
        for part in command.split([' ', '=', ';']) {
            if part.starts_with("/etc/") {
                let seen = inside.iter().any(|to| Path::new(part).starts_with(to));
                assert!(seen, "{name}: {part}");
            }
        }
    }
    for key in ["root_ca_certificate_file", "connect_certificate_file"] {
        assert!(endpoints.contains(key), "{key}");
    }
    let router = fs::read_to_string(folder.path().join("secure/router.json5")).unwrap();
    for file in ["ca.pem", "router.key", "router.pem"] {
        assert!(router.contains(&format!("\"{file}\"")), "{file}");
    }
}

#[test]
fn the_cells_of_the_containers_and_of_the_plants_page_are_pipelines() {
    let page = plants_page();
    let (_, rest) = page.split_once("```yaml\n").unwrap();
    let (plant, _) = rest.split_once("```").unwrap();
    for text in [text("container/cell7.yaml"), plant.to_owned()] {
        let folder = tempfile::tempdir().unwrap();
        // As `tauscope init` names them.
        for (from, to) in [
            ("demo_arm.urdf", "robot.urdf"),
            ("demo.explained.yaml", "twin.yaml"),
            ("demo.learnt.yaml", "learnt.yaml"),
        ] {
            fs::copy(bundled().join(from), folder.path().join(to)).unwrap();
        }
        let there = format!("{}/", folder.path().display());
        let text = text.replace("/var/lib/tauscope/", &there);
        let file = write(&folder.path().join("cell.yaml"), &text);
        let out = Out::answer([Path::new("check"), &file]);
        assert_eq!(out.code, 0, "{}", out.stderr);
    }
}

#[test]
fn the_image_holds_the_package_and_its_user() {
    let image = text("container/Containerfile");
    let package = text("package.sh");
    assert!(image.contains("COPY tauscope_*.deb "));
    assert!(package.contains("/tauscope_${version}_$debian.deb"));
    assert!(image.contains("ENTRYPOINT [\"/usr/bin/tauscope\"]"));
    assert!(package.contains("\"$root/bin/tauscope\"") && package.contains("root=$work/root/usr"));
    let [set, _] = kubernetes();
    let user = &set["spec"]["template"]["spec"]["securityContext"]["runAsUser"];
    assert!(image.contains(&format!("--uid {user} ")), "{user}");
}

#[test]
fn systemd_takes_the_units_and_finds_them_confined() {
    for (unit, instance) in [
        ("tauscope@.service", "tauscope@cell7.service"),
        ("tauscope-fleet.service", "tauscope-fleet.service"),
    ] {
        is_taken_and_confined(unit, instance);
    }
}

fn is_taken_and_confined(unit: &str, instance: &str) {
    let folder = tempfile::tempdir().unwrap();
    // It checks that the programs exist.
    let unit = text(&format!("systemd/{unit}")).replace("/usr/bin/tauscope", "/bin/true");
    let file = write(&folder.path().join(instance), &unit);
    let analyze = |words: &[&str]| {
        let mut command = Command::new("systemd-analyze");
        command.args(words).arg(&file).output()
    };
    let Ok(verified) = analyze(&["verify", "--recursive-errors=no"]) else {
        skipped(
            "systemd_takes_the_units_and_finds_them_confined",
            "systemd-analyze is absent",
        );
        return;
    };
    let said = String::from_utf8_lossy(&verified.stderr);
    assert!(verified.status.success() && said.is_empty(), "{said}");
    let confined = analyze(&["security", "--offline=true", "--threshold=30"]).unwrap();
    let said = String::from_utf8_lossy(&confined.stdout);
    assert!(confined.status.success(), "{said}");
}
