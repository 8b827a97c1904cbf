//! The pages as HTML. Every value from outside is escaped by maud; a page has no inline style or script.

pub mod cell;
mod chart;
pub mod incidents;
pub mod physics;
pub mod tile;
pub mod wall;

use maud::{DOCTYPE, Markup, html};

/// Visitor of a page.
#[derive(Debug, Clone)]
pub struct Viewer {
    /// The user, if somebody is logged in.
    pub user: Option<String>,
    /// The secret of that user's forms.
    pub csrf: Option<String>,
    /// Result of the last action.
    pub told: Option<String>,
    /// Whether anybody can log in.
    pub has_users: bool,
}

/// Disclaimer on each page.
const NOT_SAFETY: &str = "Not a safety function: what is shown here may be late, wrong or missing.";

/// Wraps the content in a page. `live`: the page follows the wall.
fn layout(viewer: &Viewer, title: &str, live: bool, content: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                @if live { noscript { meta http-equiv="refresh" content="5"; } }
                title { (title) " - tauscope fleet" }
                link rel="stylesheet" href="/style.css";
                @if live { script src="/wall.js" defer {} }
            }
            body {
                a.skip href="#content" { "To the content" }
                header.bar {
                    nav aria-label="Pages" {
                        a.brand href="/" { "tauscope fleet" }
                        a href="/incidents" { "Incidents" }
                    }
                    (account(viewer))
                }
                main #content {
                    @if let Some(told) = &viewer.told { p.told role="status" { (told) } }
                    (content)
                }
                footer { p { (NOT_SAFETY) } }
            }
        }
    }
}

fn account(viewer: &Viewer) -> Markup {
    html! {
        div.account {
            @match (&viewer.user, &viewer.csrf) {
                (Some(user), Some(csrf)) => {
                    span { (user) }
                    form method="post" action="/logout" {
                        input type="hidden" name="csrf" value=(csrf);
                        button type="submit" { "Log out" }
                    }
                }
                _ if viewer.has_users => a href="/login" { "Log in" },
                _ => span.muted { "read-only" },
            }
        }
    }
}

/// Returns the page on which a user enters a token. `why`: the reason why the last one was rejected.
pub fn login(viewer: &Viewer, why: Option<&str>) -> Markup {
    let content = html! {
        h1 { "Log in" }
        @if let Some(why) = why { p.refused role="alert" { (why) } }
        @if viewer.has_users {
            form.stack method="post" action="/login" {
                label for="token" { "Your token" }
                input #token type="password" name="token" autocomplete="current-password" maxlength="200" required autofocus;
                button type="submit" { "Log in" }
            }
        } @else {
            p { "This page is read-only: the fleet host was started without users. See "
                code { "tauscope fleet --help" } "." }
        }
    };
    layout(viewer, "Log in", false, &content)
}

/// Returns the page for a missing resource.
pub fn not_found(viewer: &Viewer, why: &str) -> Markup {
    let content = html! {
        h1 { "Not here" }
        p { (why) }
        p { a href="/" { "To the wall" } }
    };
    layout(viewer, "Not here", false, &content)
}
