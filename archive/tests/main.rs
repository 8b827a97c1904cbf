//! One program of the tests through the public face: linking one is what takes long.

mod bag_folders;
mod bags;
mod cdr;
mod common;
mod compressed;
mod csv;
mod csv_recognised;
mod damage;
mod encodings;
mod hostile_tables;
mod info;
mod join;
mod lerobot;
mod lerobot_damage;
mod limits;
mod mcap_write;
mod real_files;
mod ros1_bags;
#[path = "common/lerobot.rs"]
mod sets;
