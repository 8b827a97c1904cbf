use super::super::facts;
use super::*;

fn level(verdict: &Verdict) -> Level {
    // Every verdict other than ok comes with a remedy.
    assert_eq!(
        verdict.remedy.is_none(),
        verdict.level == Level::Ok,
        "{verdict:?}"
    );
    verdict.level
}

#[test]
fn a_machine_that_does_not_say_much_is_not_judged() {
    let verdicts = all(&Facts::default());
    let found: Vec<&Verdict> = verdicts.iter().filter(|it| it.level != Level::Ok).collect();
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn shared_memory_that_is_small_is_told_before_it_is_a_bus_error() {
    let of = |mb: u64| level(&shared_memory(&Ok(mb * 1_000_000)));
    assert_eq!(
        [of(2), of(20), of(1000)],
        [Level::Error, Level::Warning, Level::Ok]
    );
    assert_eq!(
        level(&shared_memory(&Err("denied".to_owned()))),
        Level::Error
    );
}

#[test]
fn leftovers_clock_and_limits_warn() {
    assert_eq!(level(&left_behind(&Ok(0))), Level::Ok);
    assert_eq!(level(&left_behind(&Ok(2))), Level::Warning);
    assert_eq!(level(&clock_source(Some("tsc"))), Level::Ok);
    assert_eq!(level(&clock_source(Some("hpet"))), Level::Warning);
    assert_eq!(level(&clock_synchronised(Some(false))), Level::Warning);
    assert_eq!(level(&clock_offset(0.001)), Level::Ok);
    assert_eq!(level(&clock_offset(0.02)), Level::Warning);
    assert_eq!(level(&open_files(Some(256))), Level::Warning);
    assert_eq!(level(&open_files(None)), Level::Ok);
}

#[test]
fn a_disk_is_judged_by_the_days_it_lasts() {
    let of = |free_mb: u64, mb_a_day: Option<f64>| {
        level(&folder(&Folder {
            path: "out".into(),
            writable: Ok(()),
            free_bytes: Some(free_mb * 1_000_000),
            min_free_mb: 500.0,
            bytes_a_day: mb_a_day.map(|mb| mb * 1e6),
        }))
    };
    assert_eq!(of(400, None), Level::Error);
    assert_eq!(of(600, None), Level::Ok);
    assert_eq!(of(10_500, Some(1000.0)), Level::Ok);
    assert_eq!(of(2_500, Some(1000.0)), Level::Warning);
    let closed = Folder {
        path: "out".into(),
        writable: Err("read-only".to_owned()),
        free_bytes: None,
        min_free_mb: 1.0,
        bytes_a_day: None,
    };
    assert_eq!(level(&folder(&closed)), Level::Error);
}

#[test]
fn a_port_that_is_taken_and_a_peer_that_is_away_are_errors() {
    let of = |is, possible: Result<(), &str>| {
        endpoint(&Endpoint {
            of: "ingest".to_owned(),
            at: "tls/cell:7447#connect_private_key=secret.pem".to_owned(),
            is,
            possible: possible.map_err(str::to_owned),
        })
    };
    assert_eq!(level(&of(Way::Listen, Ok(()))), Level::Ok);
    assert_eq!(level(&of(Way::Listen, Err("in use"))), Level::Error);
    let away = of(Way::Connect, Err("refused"));
    assert_eq!(level(&away), Level::Error);
    let controller = of(Way::Controller, Err("refused"));
    assert_eq!(level(&controller), Level::Error);
    assert!(!away.found.contains("secret"), "{}", away.found);
}

#[test]
fn a_certificate_is_told_of_before_it_runs_out() {
    const DAY_S: i64 = 86_400;
    let of = |from_days: i64, to_days: i64| {
        let now_s = 20_000 * DAY_S;
        let valid = Ok((now_s + from_days * DAY_S, now_s + to_days * DAY_S));
        level(&certificate(Path::new("c.pem"), &valid, now_s))
    };
    assert_eq!(of(-10, 90), Level::Ok);
    assert_eq!(of(-10, 10), Level::Warning);
    assert_eq!(of(-10, -1), Level::Error);
    assert_eq!(of(1, 90), Level::Error);
    let unreadable = Err("no such file".to_owned());
    assert_eq!(
        level(&certificate(Path::new("c.pem"), &unreadable, 0)),
        Level::Error
    );
}

#[test]
fn the_bound_of_a_clock_is_read_from_what_chrony_tracks() {
    let line = "C0A80001,192.168.0.1,3,1700000000.1,-0.000100,0.00002,0.00003,-7.5,0.001,0.02,0.004,0.0005,64.2,Normal\n";
    let error_s = facts::tracked_error_s(line).unwrap();
    assert!((error_s - 0.0026).abs() < 1e-12, "{error_s}");
    let alone = "7F7F0101,,0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,1.0,1.0,0.0,Not synchronised\n";
    assert_eq!(facts::tracked_error_s(alone), None);
    assert_eq!(facts::tracked_error_s("506 Cannot talk to daemon\n"), None);
}
