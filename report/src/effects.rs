//! Names of effects in words, and their meaning for the arm.

use tauscope_dynamics::terms;

use super::number_format::sentence_case;
use tauscope_explain::report::slip_words;

/// An effect's name in words.
pub(super) fn effect_title(effect: &str) -> String {
    let of_effect = terms::effect(effect).map(|effect| effect.words.title);
    let title = of_effect.or_else(|| slip_words::words(effect).map(|words| words.title));
    title.map_or_else(|| sentence_case(effect), str::to_owned)
}

/// Meaning of an effect, in a sentence; `None` for an unlisted effect.
pub(super) fn effect_meaning(effect: &str) -> Option<&'static str> {
    let of_effect = terms::effect(effect).map(|effect| effect.words.meaning);
    of_effect.or_else(|| slip_words::words(effect).map(|words| words.meaning))
}

/// An effect with its place: `Coulomb friction, joint3`.
pub(super) fn effect_at(effect: &str, joint: Option<&str>, link: Option<&str>) -> String {
    let title = effect_title(effect);
    match place(joint, link) {
        Some(place) => format!("{title}, {place}"),
        None => title,
    }
}

/// `joint3`, `link tool`; `None` for an effect of the whole arm.
pub(super) fn place(joint: Option<&str>, link: Option<&str>) -> Option<String> {
    match (joint, link) {
        (Some(joint), _) if mentions(joint, "joint") => Some(joint.to_owned()),
        (Some(joint), _) => Some(format!("joint {joint}")),
        (None, Some(link)) if mentions(link, "link") => Some(link.to_owned()),
        (None, Some(link)) => Some(format!("link {link}")),
        (None, None) => None,
    }
}

fn mentions(name: &str, word: &str) -> bool {
    name.to_ascii_lowercase().contains(word)
}
