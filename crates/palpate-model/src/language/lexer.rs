//! Splits the text into words, quoted texts and brackets.

use super::diagnostic::{Diagnostic, Source, Span};

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    /// Anything between separators: a keyword, a number, a name, a path.
    Word(String),
    /// Text in double quotes, without them.
    Quoted(String),
    /// `{` or `(`.
    Open(char),
    /// `}` or `)`.
    Close(char),
    /// After the last token, once and for ever.
    End,
}

/// All tokens with their places, `Token::End` last, and what is wrong with their spelling.
pub(super) fn tokens(source: &Source) -> (Vec<(Token, Span)>, Vec<Diagnostic>) {
    let text = source.text.as_str();
    let mut tokens = Vec::new();
    let mut errors = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let mut end = at + first.len_utf8();
        match first {
            ',' | '\u{feff}' => {}
            _ if first.is_whitespace() => {}
            _ if rest.starts_with("//") => end = at + rest.find('\n').unwrap_or(rest.len()),
            '{' | '(' => tokens.push((Token::Open(first), Span { start: at, end })),
            '}' | ')' => tokens.push((Token::Close(first), Span { start: at, end })),
            '"' => {
                let (content, length, is_closed) = quoted(rest);
                end = at + length;
                let span = Span { start: at, end };
                if !is_closed {
                    errors.push(source.diagnostic(
                        span,
                        "this text has no closing quote",
                        Some("a quoted text ends on its line; write \"\" for a quote in it".into()),
                    ));
                }
                tokens.push((Token::Quoted(content), span));
            }
            _ => {
                end = at + word_length(rest);
                tokens.push((Token::Word(text[at..end].to_owned()), Span { start: at, end }));
            }
        }
        at = end;
    }
    tokens.push((Token::End, Span { start: at, end: at }));
    (tokens, errors)
}

fn ends_word(c: char) -> bool {
    c.is_whitespace() || matches!(c, ',' | '{' | '}' | '(' | ')' | '"')
}

fn word_length(text: &str) -> usize {
    let end = text.find(ends_word).unwrap_or(text.len());
    text[..end].find("//").unwrap_or(end)
}

/// True when `text` reads back as one word.
pub(super) fn is_one_word(text: &str) -> bool {
    !text.is_empty() && word_length(text) == text.len() && !text.starts_with('\u{feff}')
}

/// Content and length of the quoted text that `text` begins with, and whether a quote ends it.
fn quoted(text: &str) -> (String, usize, bool) {
    let line = text.find('\n').unwrap_or(text.len());
    let mut content = String::new();
    let mut at = 1;
    while let Some(length) = text[at..line].find('"') {
        content.push_str(&text[at..at + length]);
        at += length + 1;
        if !text[at..line].starts_with('"') {
            return (content, at, true);
        }
        content.push('"');
        at += 1;
    }
    content.push_str(&text[at..line]);
    (content, line, false)
}
