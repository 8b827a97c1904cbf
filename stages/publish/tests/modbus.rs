//! Reads and writes of a PLC, with a real client.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common;

use std::net::SocketAddr;
use std::time::Duration;

use common::{Answering, endpoint, feed, publisher, says};
use tauscope_bus::Sink as _;
use tauscope_bus::command::{Answer, Request};
use tokio_modbus::ExceptionCode;
use tokio_modbus::client::{Context, tcp};
use tokio_modbus::prelude::{Reader as _, Writer as _};

const BITS: u16 = 6;
const FREE: usize = 0;
const CONTACT: usize = 1;
const COLLISION: usize = 2;
const ALIVE: usize = 5;
const ACKNOWLEDGE: u16 = 16;

async fn client(address: SocketAddr) -> Context {
    tcp::connect(address).await.unwrap()
}

const ANY_PORT: &str = "modbus: {listen: '127.0.0.1:0'}";

#[tokio::test(flavor = "multi_thread")]
async fn a_plc_reads_the_alarm_as_it_is_now() {
    let mut publisher = publisher(&format!("{{{ANY_PORT}, stop_after_s: 0.3}}"), None);
    let mut plc = client(publisher.modbus_address().unwrap()).await;
    let bits = plc.read_coils(0, BITS).await.unwrap().unwrap();
    assert_eq!(
        bits, [false; 6],
        "nothing is free before anything was heard"
    );

    feed(&mut publisher, &says(5, "free"));
    let bits = plc.read_discrete_inputs(0, BITS).await.unwrap().unwrap();
    assert!(bits[FREE] && bits[ALIVE] && !bits[CONTACT]);
    let before = plc.read_input_registers(0, 10).await.unwrap().unwrap();

    feed(&mut publisher, &says(10, "collision"));
    let bits = plc.read_discrete_inputs(0, BITS).await.unwrap().unwrap();
    assert!(!bits[FREE] && bits[CONTACT] && bits[COLLISION]);
    let words = plc.read_input_registers(0, 10).await.unwrap().unwrap();
    assert_eq!(words[1], before[1] + 1, "the heartbeat counts detections");
    assert_eq!(words[2], 4, "collision");
    assert_eq!(words[3], 2, "the second link of the robot");
    assert_eq!(words[4..8], [50, 0, 30, 40], "tenths of a newton");

    feed(&mut publisher, &says(15, "free"));
    let bits = plc.read_coils(0, BITS).await.unwrap().unwrap();
    assert!(
        !bits[FREE] && !bits[CONTACT] && bits[COLLISION],
        "it is latched"
    );

    tokio::time::sleep(Duration::from_millis(350)).await;
    let bits = plc.read_coils(0, BITS).await.unwrap().unwrap();
    assert!(!bits[ALIVE] && !bits[FREE], "silence reads as stop");
    assert!(bits[COLLISION], "and releases no latch");
    feed(&mut publisher, &says(20, "free"));
    let bits = plc.read_coils(0, BITS).await.unwrap().unwrap();
    assert!(bits[ALIVE] && bits[COLLISION] && !bits[FREE]);
    publisher.finish().unwrap();
    let bits = plc.read_coils(0, BITS).await.unwrap().unwrap();
    assert!(
        !bits[ALIVE] && bits[COLLISION] && !bits[FREE],
        "nor does the end of the run"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_publisher_that_was_started_again_is_latched_before_anything_is_heard() {
    let publisher = common::restarted(&format!("{{{ANY_PORT}}}"));
    let mut plc = client(publisher.modbus_address().unwrap()).await;
    let bits = plc.read_coils(0, BITS).await.unwrap().unwrap();
    assert!(bits[COLLISION] && !bits[FREE] && !bits[ALIVE]);
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_that_say_nothing_any_more_give_their_places_up() {
    let publisher = publisher("{modbus: {listen: '127.0.0.1:0', idle_s: 1}}", None);
    let address = publisher.modbus_address().unwrap();
    let mut all = Vec::new();
    for _ in 0..8 {
        let mut plc = client(address).await;
        plc.read_coils(0, BITS).await.unwrap().unwrap();
        all.push(plc);
    }
    let mut late = client(address).await;
    let turned_away = late.read_coils(0, BITS).await;
    assert!(turned_away.is_err(), "{turned_away:?}");
    // One client continues to poll; seven fall silent without disconnecting.
    for _ in 0..15 {
        tokio::time::sleep(Duration::from_millis(200)).await;
        all[0].read_coils(0, BITS).await.unwrap().unwrap();
    }
    for _ in 0..7 {
        let mut plc = client(address).await;
        plc.read_coils(0, BITS).await.unwrap().unwrap();
        all.push(plc);
    }
    assert!(all[1].read_coils(0, BITS).await.is_err());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_plc_acknowledges_and_mutes() {
    let endpoint = endpoint();
    let source = Answering::at(&endpoint, &Answer::Taken { stamp_ns: 5 });
    let publisher = publisher(&format!("{{{ANY_PORT}}}"), Some(&endpoint));
    let mut plc = client(publisher.modbus_address().unwrap()).await;
    // The sessions may still be connecting.
    let mut taken = plc.write_single_coil(ACKNOWLEDGE, true).await.unwrap();
    for _ in 0..20 {
        if taken.is_ok() {
            break;
        }
        taken = plc.write_single_coil(ACKNOWLEDGE, true).await.unwrap();
    }
    assert_eq!(taken, Ok(()));
    assert_eq!(source.asked.recv().unwrap(), Request::Acknowledge);
    plc.write_single_register(0, 7).await.unwrap().unwrap();
    let asked = source.asked.try_iter().last().unwrap();
    assert_eq!(asked, Request::Mute { seconds: 7.0 });
    let last = || source.asked.try_iter().last().unwrap();
    plc.write_multiple_registers(16, &[250, 0, 0, 100])
        .await
        .unwrap()
        .unwrap();
    let payload = Request::Payload {
        mass_kg: 2.5,
        com_m: [0.0, 0.0, 0.1],
    };
    assert_eq!(last(), payload);
    plc.write_single_coil(17, true).await.unwrap().unwrap();
    assert_eq!(last(), Request::Learn);
    plc.write_single_register(20, 17).await.unwrap().unwrap();
    let text = "plc 17".to_owned();
    assert_eq!(last(), Request::Label { text });
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_written_is_refused() {
    let endpoint = endpoint();
    let refusal = Answer::Refused {
        reason: "not now".to_owned(),
    };
    let source = Answering::at(&endpoint, &refusal);
    let publisher = publisher(&format!("{{{ANY_PORT}}}"), Some(&endpoint));
    let mut plc = client(publisher.modbus_address().unwrap()).await;
    let wrong = [
        (
            plc.write_single_coil(0, true).await.unwrap(),
            ExceptionCode::IllegalDataAddress,
        ),
        (
            plc.write_single_register(0, 61).await.unwrap(),
            ExceptionCode::IllegalDataValue,
        ),
        (
            plc.write_single_register(5, 1).await.unwrap(),
            ExceptionCode::IllegalDataAddress,
        ),
    ];
    for (answer, exception) in wrong {
        assert_eq!(answer, Err(exception));
    }
    assert!(
        source.asked.try_recv().is_err(),
        "none of that reached the pipeline"
    );
    let beyond = plc.read_input_registers(0, 11).await.unwrap();
    assert_eq!(beyond, Err(ExceptionCode::IllegalDataAddress));
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_source_that_takes_commands_an_acknowledgement_fails() {
    let publisher = publisher(&format!("{{{ANY_PORT}}}"), None);
    let mut plc = client(publisher.modbus_address().unwrap()).await;
    let answer = plc.write_single_coil(ACKNOWLEDGE, true).await.unwrap();
    assert_eq!(answer, Err(ExceptionCode::ServerDeviceFailure));
}
