//! Errors with their place in the text, shown like a compiler's.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// More errors than this are only counted.
const SHOWN: usize = 20;

/// A range of bytes in the text.
///
/// A place is not a content: spans always compare equal, so that documents compare by what they say.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl PartialEq for Span {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Span {
    /// From the start of `self` to the end of `other`.
    pub(super) fn to(self, other: Self) -> Self {
        Self { start: self.start, end: other.end }
    }
}

/// The text of a model file.
#[derive(Debug, Default)]
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) text: String,
}

impl Source {
    /// Line and column of a byte, both from 1; columns count characters.
    fn place(&self, byte: usize) -> (usize, usize) {
        let before = &self.text[..byte.min(self.text.len())];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    pub(super) fn diagnostic(
        &self,
        span: Span,
        message: impl Into<String>,
        hint: Option<String>,
    ) -> Diagnostic {
        let (line, column) = self.place(span.start);
        Diagnostic { path: self.path.clone(), line, column, message: message.into(), hint, span }
    }
}

/// One error in a model file.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// The model file.
    pub path: PathBuf,
    /// Line, from 1; 0 where the file could not be read at all.
    pub line: usize,
    /// Column in characters, from 1; 0 where the file could not be read at all.
    pub column: usize,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub hint: Option<String>,
    pub(super) span: Span,
}

/// Everything wrong with a model file, in the order of the text.
///
/// `Display` shows each error with its line; [`ModelError::colored`] does so for terminals.
#[derive(Clone, Debug)]
pub struct ModelError {
    /// The errors; at least one.
    pub diagnostics: Vec<Diagnostic>,
    source: Arc<Source>,
}

impl ModelError {
    pub(super) fn new(source: Arc<Source>, mut diagnostics: Vec<Diagnostic>) -> Self {
        diagnostics.sort_by_key(|diagnostic| diagnostic.span.start);
        Self { diagnostics, source }
    }

    /// An error about the file as a whole.
    pub(super) fn unreadable(path: &Path, message: String) -> Self {
        let diagnostic = Diagnostic {
            path: path.to_owned(),
            line: 0,
            column: 0,
            message,
            hint: None,
            span: Span::default(),
        };
        Self { diagnostics: vec![diagnostic], source: Arc::default() }
    }

    /// The first error.
    pub fn first(&self) -> &Diagnostic {
        &self.diagnostics[0]
    }

    /// The errors with their lines, coloured for a terminal.
    pub fn colored(&self) -> String {
        self.render(&Renderer::styled())
    }

    fn render(&self, renderer: &Renderer) -> String {
        let renderer = renderer.clone().decor_style(DecorStyle::Ascii);
        let mut parts: Vec<String> = self
            .diagnostics
            .iter()
            .take(SHOWN)
            .map(|diagnostic| self.render_one(&renderer, diagnostic))
            .collect();
        if self.diagnostics.len() > SHOWN {
            parts.push(format!("and {} more errors", self.diagnostics.len() - SHOWN));
        }
        parts.join("\n\n")
    }

    fn render_one(&self, renderer: &Renderer, diagnostic: &Diagnostic) -> String {
        let path = diagnostic.path.to_string_lossy();
        if diagnostic.line == 0 || self.source.text.is_empty() {
            let title = format!("{path}: {}", diagnostic.message);
            let mut group = Group::with_title(Level::ERROR.primary_title(title));
            if let Some(hint) = &diagnostic.hint {
                group = group.element(Level::HELP.message(hint));
            }
            return renderer.render(&[group]);
        }
        // One line is enough, and rendering stays fast in a long file.
        let text = &self.source.text;
        let start = text[..diagnostic.span.start].rfind('\n').map_or(0, |newline| newline + 1);
        let line_end = text[diagnostic.span.start..].find('\n');
        let end = line_end.map_or(text.len(), |newline| diagnostic.span.start + newline);
        let marked = diagnostic.span.start - start..diagnostic.span.end.min(end) - start;
        let snippet = Snippet::source(&text[start..end])
            .line_start(diagnostic.line)
            .path(path)
            .annotation(AnnotationKind::Primary.span(marked));
        let mut group = Level::ERROR.primary_title(&diagnostic.message).element(snippet);
        if let Some(hint) = &diagnostic.hint {
            group = group.element(Level::HELP.message(hint));
        }
        renderer.render(&[group])
    }
}

impl fmt::Display for ModelError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.render(&Renderer::plain()))
    }
}

impl std::error::Error for ModelError {}
