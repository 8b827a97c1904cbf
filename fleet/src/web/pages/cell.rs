//! A cell's page: its status, its joints compared with its peers and over weeks, its contacts, incidents and notes.

mod joints;

use maud::{Markup, html};
use tauscope_publish::message::StatusMessage;

use super::{Viewer, incidents, layout, physics, tile};
use crate::hub::Hub;
use crate::physics::CellPhysics;
use crate::store::{Day, Incident, JointNormal, KeptContact, KeptLabel, Note};
use crate::wall::{CellView, Snapshot, State};
use crate::words;

/// Number of days of history on the page. Resolution: six weeks.
const DAYS: i64 = 42;
const DAY_NS: i64 = 86_400_000_000_000;
const MOST: u32 = 50;
/// Margin of the archive before and after a contact \[ns\]. Resolution: includes the motion that led to the contact.
const AROUND_NS: i64 = 5_000_000_000;

/// Stored data of a cell; empty without a store.
#[derive(Debug, Default)]
pub struct Kept {
    days: Vec<Day>,
    normals: Vec<JointNormal>,
    baseline_ns: Option<i64>,
    contacts: Vec<KeptContact>,
    incidents: Vec<Incident>,
    notes: Vec<Note>,
    labels: Vec<KeptLabel>,
    physics: Option<CellPhysics>,
    /// Reason why something is missing.
    trouble: Option<String>,
}

impl Kept {
    /// Reads the stored data of a cell.
    pub fn read(hub: &Hub, cell: &str, now_ns: i64) -> Self {
        let read = hub.kept(|store| {
            Ok(Self {
                days: store.days(cell, now_ns - DAYS * DAY_NS)?,
                normals: store.normals(cell)?,
                baseline_ns: store.baseline_ns(cell)?,
                contacts: store.contacts(cell, MOST)?,
                incidents: store.incidents(Some(cell), MOST)?,
                notes: store.notes(cell, MOST)?,
                labels: store.labels(Some(cell), MOST)?,
                physics: None,
                trouble: None,
            })
        });
        let trouble = |trouble: String| Self {
            trouble: Some(trouble),
            ..Self::default()
        };
        let kept = match read {
            Some(Ok(kept)) => kept,
            Some(Err(error)) => trouble(error.to_string()),
            None => trouble("this fleet host keeps no history".to_owned()),
        };
        Self {
            physics: hub.physics(cell),
            ..kept
        }
    }
}

/// The page of the cell `name`, which is in the snapshot.
pub fn page(viewer: &Viewer, snapshot: &Snapshot, name: &str, kept: &Kept) -> Markup {
    let Some(view) = snapshot.cell(name) else {
        return super::not_found(viewer, "this cell is no longer known to the fleet host");
    };
    let status = view.status.as_ref();
    let unit = status.map_or("", |status| status.effort_unit.as_str());
    let content = html! {
        p.path { a href="/" { "Wall" } " / " (name) }
        h1 { (name) }
        p #lost role="alert" hidden {
            strong { "The connection to the fleet host is lost." } " The data on this page is outdated."
        }
        div.top {
            div #tile data-cell=(name) { (tile::tile(view, snapshot.now_ns)) }
            (actions(viewer, view))
        }
        @if let Some(trouble) = &kept.trouble { p.refused role="alert" { (trouble) } }
        section aria-labelledby="joints" {
            h2 #joints { "Joints" }
            (joints::section(snapshot, view, kept, unit))
        }
        section aria-labelledby="physics" {
            h2 #physics { "Physics over weeks" }
            (physics::section(kept.physics.as_ref(), &kept.notes, snapshot.now_ns))
        }
        section aria-labelledby="contacts" {
            h2 #contacts { "Contacts" }
            (contacts(kept, snapshot.now_ns))
        }
        section aria-labelledby="incidents" {
            h2 #incidents { "Incidents" }
            (incidents::table(&kept.incidents, &kept.labels, snapshot.now_ns, false))
        }
        section aria-labelledby="notes" {
            h2 #notes { "Maintenance notes" }
            (notes(viewer, name, kept))
        }
        @if let Some(status) = status { section aria-labelledby="facts" {
            h2 #facts { "The cell's program" }
            (facts(view, status, snapshot.now_ns))
        } }
    };
    layout(viewer, name, true, &content)
}

/// The forms of a user.
fn actions(viewer: &Viewer, view: &CellView) -> Markup {
    let Some(csrf) = &viewer.csrf else {
        return html! {
            div.actions { p.muted {
                @if viewer.has_users { a href="/login" { "Log in" } " to acknowledge, mute, label or note." }
                @else { "This page is read-only: the fleet host was started without users." }
            } }
        };
    };
    let takes = view
        .status
        .as_ref()
        .is_some_and(|status| status.takes_commands);
    let takes = takes && !matches!(view.state, State::Ended { .. } | State::NeverSeen);
    let to = |what: &str| format!("/cells/{}/{what}", view.cell);
    let secret = html! { input type="hidden" name="csrf" value=(csrf); };
    html! {
        div.actions {
            form method="post" action=(to("acknowledge")) {
                (secret)
                button.main type="submit" { "Acknowledge" }
                @if view.status.is_none() { p.muted { "Only noted here: the cell has not sent a status yet." } }
                @else if !takes { p.muted { "Only noted here: the cell takes no commands." } }
            }
            @if takes {
                form method="post" action=(to("mute")) {
                    (secret)
                    label for="seconds" { "Mute for (s)" }
                    input #seconds type="number" name="seconds" min="0" max="60" step="1" value="10" required;
                    button type="submit" { "Mute" }
                }
                form method="post" action=(to("label")) {
                    (secret)
                    label for="label" { "Label in the archive" }
                    input #label type="text" name="text" maxlength="48" required;
                    button type="submit" { "Label" }
                }
            }
        }
    }
}

fn contacts(kept: &Kept, now_ns: i64) -> Markup {
    let onset = |one: &KeptContact| one.contact.onset_ns;
    let is_shown = |label: &&KeptLabel| {
        kept.contacts
            .iter()
            .any(|one| label.onset_ns == Some(onset(one)))
    };
    let (_, others): (Vec<&KeptLabel>, Vec<&KeptLabel>) = kept.labels.iter().partition(is_shown);
    html! {
        @if kept.contacts.is_empty() { p.muted { "none" } }
        @else { (contacts_table(kept, now_ns)) }
        @if !others.is_empty() {
            p.muted { "Labels in the archive that are about none of these contacts:" }
            ul.notes { @for one in others { li { (incidents::label(one)) } } }
        }
    }
}

fn contacts_table(kept: &Kept, now_ns: i64) -> Markup {
    html! {
        div.wide role="region" aria-label="Contacts" tabindex="0" {
            table.fold {
                thead { tr {
                    th scope="col" { "When" } th scope="col" { "What" } th.num scope="col" { "Lasted" }
                    th scope="col" { "Acknowledged" } th scope="col" { "In the archive" }
                } }
                tbody { @for KeptContact { contact, host, archive } in &kept.contacts { tr {
                    td.full data-label="When" { (tile::stamp(contact.onset_ns, &words::time(contact.onset_ns))) }
                    td.full data-label="What" { (words::contact(contact)) @if contact.latched { span.muted { ", latched" } }
                        @for one in kept.labels.iter().filter(|one| one.onset_ns == Some(contact.onset_ns)) {
                            div.label { (incidents::label(one)) }
                        }
                    }
                    td.num data-label="Lasted" { @match contact.end_ns {
                        Some(end_ns) => (format!("{:.2} s", (end_ns - contact.onset_ns).max(0) as f64 * 1e-9)),
                        None => "lasts",
                    } }
                    td data-label="Acknowledged" { @match (&contact.acknowledged_by, contact.acknowledged_ns) {
                        (Some(by), _) => (by),
                        (None, Some(at_ns)) => (tile::stamp(at_ns, &words::age_at(at_ns, now_ns))) ,
                        (None, None) => span.muted { "no" },
                    } }
                    td.full data-label="In the archive" { @match archive {
                        Some(archive) => {
                            @for name in archive.split(", ") { code { @if !host.is_empty() { (host) ":" } (name) } br; }
                            span.muted { (words::time_of_day(contact.begin_ns - AROUND_NS)) " to "
                                (words::time_of_day(contact.end_ns.unwrap_or(contact.onset_ns) + AROUND_NS)) }
                        }
                        None => span.muted { "no recorder" },
                    } }
                } } }
            }
        }
    }
}

fn notes(viewer: &Viewer, cell: &str, kept: &Kept) -> Markup {
    html! {
        @match kept.baseline_ns {
            Some(at_ns) => p { "Normal is learned from " (tile::stamp(at_ns, &words::time(at_ns))) " on, over the first day." },
            None => p.muted { "Normal is learned over the first day that this host has seen; before that it is the calibration's." },
        }
        @if !kept.notes.is_empty() {
            ul.notes { @for note in &kept.notes { li {
                (tile::stamp(note.at_ns, &words::time(note.at_ns))) ", " (note.by) ": " (note.text)
                @if note.baseline { " " span.count data-severity="notice" { "new baseline" } }
            } } }
        }
        @if let Some(csrf) = &viewer.csrf {
            form.stack method="post" action={ "/cells/" (cell) "/note" } {
                input type="hidden" name="csrf" value=(csrf);
                label for="note" { "Note" }
                input #note type="text" name="text" maxlength="200" required;
                label.check { input type="checkbox" name="baseline" value="on"; " The arm is another one from here on: learn its normal anew" }
                button type="submit" { "Note" }
            }
        }
    }
}

fn facts(view: &CellView, status: &StatusMessage, now_ns: i64) -> Markup {
    let none = "none".to_owned();
    html! {
        dl.facts {
            dt { "Robot" } dd { (status.robot) }
            dt { "Host" } dd { (status.host) }
            dt { "tauscope" } dd { (status.tauscope) }
            dt { "Status sent" } dd { (tile::stamp(status.sent_ns, &words::time(status.sent_ns))) ", "
                (words::age_at(status.sent_ns, now_ns)) " ago" }
            dt { "Clock" } dd { @match view.clock_ahead_ms {
                Some(_) => span.warn[view.clock_is_off] { (words::clock(view)) },
                None => "not measured yet",
            } }
            dt { "Twin, SHA-256" } dd { code { (status.twin_sha256.as_ref().unwrap_or(&none)) } }
            dt { "URDF, SHA-256" } dd { code { (status.urdf_sha256.as_ref().unwrap_or(&none)) } }
        }
        div.wide role="region" aria-label="Stages" tabindex="0" {
            table.fold {
                thead { tr {
                    th scope="col" { "Stage" } th.num scope="col" { "Received" } th.num scope="col" { "Emitted" }
                    th.num scope="col" { "Lost" } th.num scope="col" { "Restarts" } th scope="col" { "As of" }
                } }
                tbody { @for stage in &status.stages { tr {
                    th scope="row" { (stage.stage) }
                    td.num data-label="Received" { (stage.received) } td.num data-label="Emitted" { (stage.emitted) }
                    td.num.warn[stage.dropped > 0] data-label="Lost" { (stage.dropped) }
                    td.num data-label="Restarts" { (stage.restarts) }
                    td data-label="As of" { (tile::stamp(stage.stamp_ns, &words::time_of_day(stage.stamp_ns))) }
                } } }
            }
        }
    }
}
