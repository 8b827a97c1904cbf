//! Prints the tables of docs/simulators.md.

fn main() {
    print!("{}", tauscope_report::models::table());
}
