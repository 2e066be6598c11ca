//! `skylit completions` and `skylit man`.

use super::{command, print};
use crate::error::{Error, Result, unknown_name};
use clap::Args;

/// Flags of `skylit completions`.
#[derive(Args)]
pub struct CompletionsArgs {
    /// The shell
    shell: clap_complete::Shell,
}

/// Flags of `skylit man`.
#[derive(Args)]
pub struct ManArgs {
    /// The page of one verb instead of the whole command's, such as `render` or `bench rays`
    #[arg(value_name = "VERB")]
    verbs: Vec<String>,
}

/// Prints a shell's completions.
pub fn completions(args: &CompletionsArgs) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command(), "skylit", &mut text);
    print(&text)
}

/// Prints a manual page in roff.
pub fn man(args: &ManArgs) -> Result<()> {
    let mut whole = command();
    whole.build();
    let (mut page, mut full_name) = (whole, String::from("skylit"));
    for name in &args.verbs {
        let Some(verb) = page.find_subcommand(name).cloned() else {
            let known = page.get_subcommands().filter(|c| !c.is_hide_set()).map(clap::Command::get_name);
            return Err(Error::Usage(match page.has_subcommands() {
                true => unknown_name("verb", name, known),
                false => format!("\"{}\" has no verbs of its own, such as \"{name}\"", args.verbs.join(" ")),
            }));
        };
        page = verb;
        full_name += &format!("-{name}");
    }
    let page = page.display_name(full_name);
    let mut text = Vec::new();
    let rendered = clap_mangen::Man::new(page).render(&mut text);
    rendered.map_err(|e| Error::Internal(format!("cannot make the manual page: {e}")))?;
    print(&text)
}
