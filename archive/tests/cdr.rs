//! Messages to bytes and back.

use proptest::prelude::*;
use tauscope_archive::ros::{
    DecodeError, DiagnosticArray, DiagnosticStatus, Header, Inertia, InertiaStamped, JointState,
    KeyValue, Message, Time, Wrench, WrenchStamped, decode, decode_into, encode,
};

fn header() -> impl Strategy<Value = Header> {
    (0..=i32::MAX, 0..1_000_000_000_u32, ".{0,12}").prop_map(|(sec, nanosec, frame_id)| Header {
        stamp: Time { sec, nanosec },
        frame_id: frame_id.replace('\0', ""),
    })
}

fn text() -> impl Strategy<Value = String> {
    ".{0,9}".prop_map(|text| text.replace('\0', ""))
}

prop_compose! {
    fn joint_state()(header in header(), name in prop::collection::vec(text(), 0..9))(
        position in prop_oneof![
            Just(vec![]),
            prop::collection::vec(prop::num::f64::ANY, name.len()),
        ],
        effort in prop_oneof![
            Just(vec![]),
            prop::collection::vec(prop::num::f64::ANY, name.len()),
        ],
        header in Just(header),
        name in Just(name),
    ) -> JointState {
        JointState { header, name, position, velocity: vec![], effort }
    }
}

prop_compose! {
    fn diagnostics()(
        header in header(),
        status in prop::collection::vec(
            (0..4_u8, text(), text(), prop::collection::vec((text(), text()), 0..4)), 0..4),
    ) -> DiagnosticArray {
        let pair = |(key, value)| KeyValue { key, value };
        let status = status.into_iter().map(|(level, name, message, values)| DiagnosticStatus {
            level,
            name,
            message,
            hardware_id: String::new(),
            values: values.into_iter().map(pair).collect(),
        });
        DiagnosticArray { header, status: status.collect() }
    }
}

/// NaN is not equal to itself, but its bytes are.
fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

proptest! {
    #[test]
    fn a_joint_state_comes_back(state in joint_state(), before in joint_state()) {
        let mut body = Vec::new();
        encode(&state, &mut body).unwrap();
        let mut back = before;
        decode_into(&body, &mut back).unwrap();
        prop_assert_eq!(&back.header, &state.header);
        prop_assert_eq!(&back.name, &state.name);
        prop_assert_eq!(bits(&back.position), bits(&state.position));
        prop_assert_eq!(bits(&back.velocity), bits(&state.velocity));
        prop_assert_eq!(bits(&back.effort), bits(&state.effort));
    }

    #[test]
    fn diagnostics_come_back(message in diagnostics()) {
        let mut body = Vec::new();
        encode(&message, &mut body).unwrap();
        prop_assert_eq!(decode::<DiagnosticArray>(&body).unwrap(), message);
    }

    #[test]
    fn a_joint_state_cut_anywhere_is_an_error(state in joint_state(), cut in any::<prop::sample::Index>()) {
        let mut body = Vec::new();
        encode(&state, &mut body).unwrap();
        body.truncate(cut.index(body.len()));
        prop_assert!(decode::<JointState>(&body).is_err());
    }

    #[test]
    fn no_bytes_make_it_panic(mut body in prop::collection::vec(any::<u8>(), 0..200), big: bool) {
        if let Some(header) = body.first_chunk_mut() {
            *header = [0, u8::from(!big), 0, 0];
        }
        let _ = decode::<JointState>(&body);
        let _ = decode::<DiagnosticArray>(&body);
    }
}

#[test]
fn what_has_a_fixed_shape_comes_back() {
    let header = Header::new(1_500_000_001, "tool");
    let wrench = WrenchStamped {
        header: header.clone(),
        wrench: Wrench {
            force: [1.0, 2.0, 3.0].into(),
            torque: [4.0, 5.0, 6.0].into(),
        },
    };
    let inertia = InertiaStamped {
        header,
        inertia: Inertia {
            m: 1.0,
            com: [2.0, 3.0, 4.0].into(),
            izz: 5.0,
            ..Inertia::default()
        },
    };
    let mut body = Vec::new();
    encode(&wrench, &mut body).unwrap();
    assert_eq!(decode::<WrenchStamped>(&body).unwrap(), wrench);
    encode(&inertia, &mut body).unwrap();
    assert_eq!(decode::<InertiaStamped>(&body).unwrap(), inertia);
}

/// Written by hand after the CDR rules, little endian: two joints, no velocities.
const LITTLE: &[u8] = &[
    0, 1, 0, 0, // encapsulation
    7, 0, 0, 0, 9, 0, 0, 0, // stamp
    2, 0, 0, 0, b'f', 0, 0, 0, // frame, padded
    2, 0, 0, 0, // names
    2, 0, 0, 0, b'a', 0, 0, 0, //
    2, 0, 0, 0, b'b', 0, 0, 0, //
    2, 0, 0, 0, // positions; the count ends at 40 of 40, so no padding
    0, 0, 0, 0, 0, 0, 0xf0, 0x3f, // 1
    0, 0, 0, 0, 0, 0, 0, 0x40, // 2
    0, 0, 0, 0, // velocities: the count alone
    2, 0, 0, 0, // efforts
    0, 0, 0, 0, 0, 0, 0, 0xc0, // -2
    0, 0, 0, 0, 0, 0, 0, 0, // 0
];

#[test]
fn bytes_are_laid_out_as_cdr_says() {
    let state = JointState {
        header: Header {
            stamp: Time { sec: 7, nanosec: 9 },
            frame_id: "f".to_owned(),
        },
        name: vec!["a".to_owned(), "b".to_owned()],
        position: vec![1.0, 2.0],
        velocity: vec![],
        effort: vec![-2.0, 0.0],
    };
    let mut body = Vec::new();
    encode(&state, &mut body).unwrap();
    assert_eq!(body, LITTLE);
    assert_eq!(decode::<JointState>(LITTLE).unwrap(), state);

    // Big endian: the bytes of every number are reversed, those of texts are not.
    let mut big = LITTLE.to_vec();
    big[1] = 0;
    let numbers = [4, 8, 12, 20, 24, 32, 40, 60, 64].map(|at| at..at + 4);
    let floats = [44, 52, 68, 76].map(|at| at..at + 8);
    for range in numbers.into_iter().chain(floats) {
        big[range].reverse();
    }
    assert_eq!(decode::<JointState>(&big).unwrap(), state);
}

#[test]
fn what_breaks_the_rules_is_told() {
    let good = decode::<JointState>(LITTLE).unwrap();
    let broken = |change: fn(&mut JointState)| {
        let mut state = good.clone();
        change(&mut state);
        let mut body = Vec::new();
        encode(&state, &mut body).unwrap();
        decode::<JointState>(&body).unwrap_err().to_string()
    };
    assert_eq!(
        broken(|state| state.header.stamp.sec = -1),
        "stamp -1 s 9 ns is not a time since the epoch"
    );
    assert_eq!(
        broken(|state| state.effort.push(1.0)),
        "`effort` has 3 entries for 2 names (a, b): it is unknown which belongs to which. Make the driver send a value for each name, or only the names that it has values for, and record again"
    );

    let with = |at: usize, byte| {
        let mut body = LITTLE.to_vec();
        body[at] = byte;
        decode::<JointState>(&body).unwrap_err()
    };
    assert!(matches!(
        with(1, 3),
        DecodeError::Encapsulation { id: [0, 3] }
    ));
    // A count of two thousand million names: an error, and no memory taken for them.
    assert!(matches!(with(23, 0x80), DecodeError::Fields { .. }));
    assert!(matches!(
        decode::<JointState>(&[]),
        Err(DecodeError::TooShort { len: 0 })
    ));
    let padded = [LITTLE, &[0; 7]].concat();
    assert!(decode::<JointState>(&padded).is_ok());
    let other = [LITTLE, &[0; 8]].concat();
    assert!(matches!(
        decode::<JointState>(&other),
        Err(DecodeError::LeftOver { extra: 8, .. })
    ));
}

#[test]
fn names_and_texts_are_as_ros_has_them() {
    assert_eq!(
        JointState::dds_type(),
        "sensor_msgs::msg::dds_::JointState_"
    );
    let line = "=".repeat(80);
    assert_eq!(
        JointState::definition(),
        format!(
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
             float64[] effort\n{line}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\n\
             string frame_id\n{line}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
        )
    );
}
