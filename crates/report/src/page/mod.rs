//! Pages about episodes and runs.

mod episode;
mod run;
mod suite;
#[cfg(test)]
mod tests;

use maud::html;
use page::{Markup, document};

pub use episode::episode_page;
pub use run::run_page;
pub use suite::{Suite, suite_page};

/// A page under this title.
fn titled(title: &str, body: &Markup) -> String {
    document(title, &html! { h1 { (title) } "\n" (body) })
}
