//! Capabilities of the terminal, if there is one.

use std::io::IsTerminal as _;

/// Whether standard error is a terminal that can draw over what it has drawn.
pub fn can_redraw() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Whether colours are wanted there (<https://no-color.org>).
pub fn has_colour() -> bool {
    can_redraw() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}
