//! A subset of G-code (RS274/NGC) as interpreted by LinuxCNC: lines, arcs in the XY plane, dwells,
//! units, absolute and incremental. Unsupported words are refused with their line.

use super::block::Block;
use super::error::GcodeError;
use super::modal::Modal;
use super::part_program::{GcodeProgram, GcodeSetting};
use super::text::{shown, without_mark};
use super::token::{Kind, Token, Tokens};

/// Reads a program: UTF-8 or any extension of ASCII, as comments may hold any bytes.
///
/// A program that begins with `%` ends with the next `%`; any program ends with M2 or M30, or with
/// the text. The text after its end is ignored.
///
/// # Errors
/// [`GcodeError`] for the first word that is unsupported, or not allowed in its place.
pub fn read_gcode(text: &[u8], setting: &GcodeSetting) -> Result<GcodeProgram, GcodeError> {
    let text = without_mark(text).map_err(|reason| GcodeError {
        line: 1,
        word: "its encoding".to_owned(),
        allowed: reason.to_owned(),
    })?;
    let mut modal = Modal::new(setting);
    let mut tokens = Tokens::of(text);
    let mut delimited = Delimited::default();
    loop {
        let line = tokens.line();
        let (block, ended) = read_block(&mut tokens, &mut delimited, setting)?;
        match ended {
            Ended::Program => return Ok(modal.program),
            Ended::Line | Ended::Text => modal.block(&block)?,
        }
        if block.ends {
            return Ok(modal.program);
        }
        if ended == Ended::Text {
            if delimited.opened {
                return Err(GcodeError {
                    line,
                    word: "end of the text".to_owned(),
                    allowed:
                        "a program that begins with % ends with %, M2 or M30: the rest is missing"
                            .to_owned(),
                });
            }
            return Ok(modal.program);
        }
    }
}

/// End of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    /// At the end of its line.
    Line,
    /// At the end of the text.
    Text,
    /// At the `%` that ends the program.
    Program,
}

/// State between the percent signs of the program.
#[derive(Clone, Copy, Debug, Default)]
struct Delimited {
    /// True once something but blanks has been read.
    begun: bool,
    /// True if that was a `%`.
    opened: bool,
}

/// Reads the words of the next line.
fn read_block<'a>(
    tokens: &mut Tokens<'a>,
    delimited: &mut Delimited,
    setting: &GcodeSetting,
) -> Result<(Block<'a>, Ended), GcodeError> {
    let mut block = Block::new(tokens.line());
    let (mut skipped, mut percent) = (false, false);
    for token in tokens {
        let refuse = |allowed: &str| {
            Err(GcodeError {
                line: token.line,
                word: shown(token.text),
                allowed: allowed.to_owned(),
            })
        };
        let first = !delimited.begun;
        match token.kind {
            Kind::LineEnd => return Ok((block, Ended::Line)),
            Kind::Blank => continue,
            Kind::OpenComment => return refuse("a comment ends with ) in its line"),
            Kind::NestedComment => return refuse("comments do not nest: one ( for each )"),
            Kind::Percent if percent || skipped || !block.is_empty() => {
                return refuse("% stands alone in its line");
            }
            Kind::Percent if first => (delimited.opened, percent) = (true, true),
            Kind::Percent if delimited.opened => return Ok((block, Ended::Program)),
            Kind::Percent => return refuse("% ends a program only that begins with %"),
            _ if percent => return refuse("% stands alone in its line"),
            Kind::Slash if skipped || !block.is_empty() => {
                return refuse("/ stands at the beginning of its block");
            }
            Kind::Slash => skipped = true,
            Kind::Comment => {}
            Kind::Word | Kind::Stray if skipped && setting.block_delete => {}
            Kind::Word => block.take(&token, setting.exact_corners)?,
            Kind::Stray => return Err(stray(&token)),
        }
        delimited.begun = true;
    }
    Ok((block, Ended::Text))
}

/// Returns the refusal of a character that begins no word.
fn stray(token: &Token) -> GcodeError {
    let allowed = match token.text[0] {
        b'#' | b'=' | b'<' | b'>' => "parameters are not read: write a number after the letter",
        b'[' | b']' | b'*' => "expressions are not read: write a number after the letter",
        b')' => "no comment ends here: ( is missing",
        0 => "a text has no character 0: save it in UTF-8 or plain ASCII",
        _ => "cannot be read: words are a letter and a number, such as X-1.5",
    };
    GcodeError { line: token.line, word: shown(token.text), allowed: allowed.to_owned() }
}

#[cfg(test)]
mod tests;
