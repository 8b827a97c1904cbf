//! Byte layout of the samples, for readers in other languages.
//!
//! The layout is the same in shared memory and in a Zenoh payload: C layout, little-endian, without padding. `f64` is
//! IEEE 754; `[f64; 16]` has one entry per joint in URDF order, of which the first `joint_count` are valid; a name is
//! 48 bytes of UTF-8, zero-padded. Offsets in bytes:
//!
//! | every sample | type | at |
//! | --- | --- | --- |
//! | `header.stamp_ns` | `i64` | 0 |
//! | `header.received_ns` | `i64` | 8 |
//! | `header.sequence` | `u64` | 16 |
//! | `header.flags` | `u32` | 24 |
//! | `header.joint_count` | `u32` | 28 |
//!
//! | `tauscope/JointState/2`, 968 bytes | type | at |
//! | --- | --- | --- |
//! | `position` | `[f64; 16]` | 32 |
//! | `velocity` | `[f64; 16]` | 160 |
//! | `effort` | `[f64; 16]` | 288 |
//! | `command_position` | `[f64; 16]` | 416 |
//! | `command_velocity` | `[f64; 16]` | 544 |
//! | `reference_effort` | `[f64; 16]` | 672 |
//! | `tool_mass_kg` | `f64` | 800 |
//! | `tool_com_m` | `[f64; 3]` | 808 |
//! | `tool_inertia_kgm2` | `[f64; 6]` | 832 |
//! | `command.verb` | `u32` | 880 |
//! | `command.reserved` | `u32` | 884 |
//! | `command.value` | `f64` | 888 |
//! | `command.com_m` | `[f64; 3]` | 896 |
//! | `command.text` | name | 920 |
//!
//! | `tauscope/TwinState/1`, 1056 bytes | type | at |
//! | --- | --- | --- |
//! | `position` | `[f64; 16]` | 32 |
//! | `velocity` | `[f64; 16]` | 160 |
//! | `acceleration` | `[f64; 16]` | 288 |
//! | `effort` | `[f64; 16]` | 416 |
//! | `expected_effort` | `[f64; 16]` | 544 |
//! | `filtered_effort` | `[f64; 16]` | 672 |
//! | `filtered_expected_effort` | `[f64; 16]` | 800 |
//! | `residual` | `[f64; 16]` | 928 |
//!
//! | `tauscope/Detection/4`, 384 bytes | type | at |
//! | --- | --- | --- |
//! | `detector` | name | 32 |
//! | `state` | name | 80 |
//! | `link` | name | 128 |
//! | `other_link` | name | 176 |
//! | `score` | `f64` | 224 |
//! | `threshold` | `f64` | 232 |
//! | `contact_ns` | `i64` | 240 |
//! | `force_n` | `[f64; 3]` | 248 |
//! | `point_m` | `[f64; 3]` | 272 |
//! | `joints` | `u32` | 296 |
//! | `event` | `u32` | 300 |
//! | `size` | `f64` | 304 |
//! | `content_n` | `[f64; 3]` | 312 |
//! | `rise_direction` | `[f64; 3]` | 336 |
//! | `motion_direction` | `[f64; 3]` | 360 |
//!
//! | `tauscope/Health/1`, 112 bytes | type | at |
//! | --- | --- | --- |
//! | `stage` | name | 32 |
//! | `received` | `u64` | 80 |
//! | `emitted` | `u64` | 88 |
//! | `dropped` | `u64` | 96 |
//! | `restarts` | `u64` | 104 |
//!
//! The bits of `flags` are those of [`flags`](crate::flags).

#[cfg(target_endian = "big")]
compile_error!("samples are little-endian on the wire and in memory");

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::mem::offset_of;

    use crate::sample::{Command, Detection, Header, Health, JointState, TwinState};

    /// Size in bytes where it is given, and the offset of each field.
    type Layout = (Option<usize>, Vec<(String, usize)>);

    macro_rules! layout {
        ($type:ident: $($field:ident),+) => {
            [$((stringify!($field), offset_of!($type, $field))),+]
        };
    }

    /// The table in the text above, by sample type.
    fn tables() -> BTreeMap<String, Layout> {
        let mut tables = BTreeMap::new();
        let mut current = String::new();
        for line in include_str!("wire.rs").lines() {
            let Some(row) = line.strip_prefix("//! |") else {
                continue;
            };
            let cells: Vec<_> = row
                .split('|')
                .map(|cell| cell.trim().replace('`', ""))
                .collect();
            if cells[2] == "at" {
                let mut title = cells[0].split(", ");
                current = title.next().unwrap().to_owned();
                let size = title
                    .next()
                    .map(|text| text.trim_end_matches(" bytes").parse().unwrap());
                tables.insert(current.clone(), (size, Vec::new()));
            } else if let Ok(offset) = cells[2].parse() {
                let rows = &mut tables.get_mut(&current).unwrap().1;
                rows.push((cells[0].clone(), offset));
            }
        }
        tables
    }

    fn rows<const N: usize>(rows: [(&str, usize); N]) -> Vec<(String, usize)> {
        rows.map(|(name, offset)| (name.to_owned(), offset)).into()
    }

    #[test]
    fn the_documented_offsets_are_those_of_the_types() {
        let tables = tables();
        let header = layout!(Header: stamp_ns, received_ns, sequence, flags, joint_count);
        let header = rows(header)
            .into_iter()
            .map(|(name, offset)| (format!("header.{name}"), offset))
            .collect();
        assert_eq!(tables["every sample"], (None, header));
        let command = rows(layout!(Command: verb, reserved, value, com_m, text))
            .into_iter()
            .map(|(name, at)| {
                (
                    format!("command.{name}"),
                    at + offset_of!(JointState, command),
                )
            })
            .collect::<Vec<_>>();
        assert_eq!(
            tables["tauscope/JointState/2"],
            (
                Some(size_of::<JointState>()),
                [
                    rows(
                        layout!(JointState: position, velocity, effort, command_position,
                    command_velocity, reference_effort, tool_mass_kg, tool_com_m, tool_inertia_kgm2)
                    ),
                    command
                ]
                .concat()
            )
        );
        assert_eq!(
            tables["tauscope/TwinState/1"],
            (
                Some(size_of::<TwinState>()),
                rows(
                    layout!(TwinState: position, velocity, acceleration, effort, expected_effort,
                    filtered_effort, filtered_expected_effort, residual)
                )
            )
        );
        assert_eq!(
            tables["tauscope/Detection/4"],
            (
                Some(size_of::<Detection>()),
                rows(
                    layout!(Detection: detector, state, link, other_link, score, threshold, contact_ns,
                    force_n, point_m, joints, event, size, content_n, rise_direction, motion_direction)
                )
            )
        );
        assert_eq!(
            tables["tauscope/Health/1"],
            (
                Some(size_of::<Health>()),
                rows(layout!(Health: stage, received, emitted, dropped, restarts))
            )
        );
    }
}
