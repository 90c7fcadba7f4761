//! Brackets: opened, closed, left out, too many or too few; and what is skipped over.

use super::diagnostic::Span;
use super::lexer::Token;
use super::parser::{Item, Parser, is_keyword};

/// How a block was opened.
#[derive(Clone, Copy)]
pub(super) struct Opening {
    /// The bracket; `None` where it is missing.
    bracket: Option<char>,
    pub(super) span: Span,
}

impl Parser<'_> {
    /// Skips to the next element keyword or to the bracket that closes the current block.
    pub(super) fn skip_to_element(&mut self) {
        loop {
            match self.peek().0 {
                Token::End | Token::Close(_) => return,
                Token::Word(word) if is_keyword(word) => return,
                Token::Open(_) => self.skip_block(),
                _ => drop(self.advance()),
            }
        }
    }

    /// Skips a name and a bracketed block, brackets in it counted.
    pub(super) fn skip_block(&mut self) {
        while matches!(self.peek().0, Token::Word(_) | Token::Quoted(_)) {
            self.advance();
        }
        let mut depth = 0_usize;
        loop {
            match self.peek().0 {
                Token::Open(_) => depth += 1,
                Token::Close(_) if depth > 0 => depth -= 1,
                Token::End | Token::Close(_) => return,
                _ => {}
            }
            self.advance();
            if depth == 0 {
                return;
            }
        }
    }

    pub(super) fn open(&mut self, keyword: &str, keyword_span: Span) -> Opening {
        let (token, span) = self.peek();
        if let Token::Open(bracket) = token {
            let bracket = Some(*bracket);
            self.advance();
            return Opening { bracket, span };
        }
        let found = self.found();
        self.error(span, format!("expected `{{` after {keyword}, found {found}"));
        self.surplus -= 1;
        Opening { bracket: None, span: keyword_span }
    }

    /// The bracket after an element, which may be left out.
    pub(super) fn open_optional(&mut self) -> Option<Opening> {
        let (token, span) = self.peek();
        let Token::Open(bracket) = token else { return None };
        let bracket = Some(*bracket);
        self.advance();
        Some(Opening { bracket, span })
    }

    pub(super) fn close(&mut self, item: &Item, opening: Opening) {
        match item {
            Item::Close => self.close_bracket(opening),
            _ => self.unclosed(opening),
        }
    }

    pub(super) fn close_bracket(&mut self, opening: Opening) {
        let (token, span) = self.peek();
        let Token::Close(found) = *token else { return };
        self.advance();
        let Some(bracket) = opening.bracket else { return };
        let expected = if bracket == '{' { '}' } else { ')' };
        if found != expected && self.kinds_matter {
            self.kinds_matter = false;
            self.error(
                span,
                format!(
                    "expected `{expected}` to close the `{bracket}` of this block, found `{found}`"
                ),
            );
        }
    }

    /// Reports a bracket that is still open where its block must end; once for each that is missing.
    pub(super) fn unclosed(&mut self, opening: Opening) {
        if self.surplus < 0 {
            self.surplus += 1;
            self.error(opening.span, "this bracket is never closed");
        }
    }

    /// Reports and drops a closing bracket that would end an unfinished block, when there is one too
    /// many of them anyway.
    pub(super) fn drop_surplus(&mut self) -> bool {
        if self.surplus <= 0 {
            return false;
        }
        self.surplus -= 1;
        let (found, span) = (self.found(), self.peek().1);
        self.error_with_hint(
            span,
            format!("this {found} closes nothing"),
            "the block around it is not finished: remove it, or open a bracket for it after ME",
        );
        self.advance();
        true
    }
}
