//! Recursive descent over the tokens; every error is reported once and parsing goes on.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::brackets::Opening;
use super::diagnostic::{Diagnostic, ModelError, Source, Span};
use super::document::{Block, Branch, Document, Settings, Tree, Unit};
use super::lexer::{Token, tokens};
use super::near::near_miss;
use crate::body::Material;

const ELEMENTS: [&str; 12] =
    ["BRANCH", "TREE", "ME", "PE", "NE", "MT", "FX", "RG", "CN", "VE", "IV", "AT"];
const IN_BRANCH: [&str; 7] = ["ME", "MT", "CN", "VE", "AT", "BRANCH", "TREE"];
const IN_TREE: [&str; 9] = ["ME", "PE", "NE", "MT", "FX", "RG", "CN", "VE", "IV"];

/// Entries but the parameters of materials, and the element that each stands in.
const ENTRIES: [(&str, &str); 19] = [
    ("trans", "ME"),
    ("rot", "ME"),
    ("scale", "ME"),
    ("law", "MT"),
    ("fibre", "MT"),
    ("fibre_2", "MT"),
    ("region", "MT"),
    ("friction", "CN"),
    ("distance", "CN"),
    ("stiffness", "CN"),
    ("self", "CN"),
    ("color", "VE"),
    ("opacity", "VE"),
    ("box", "FX"),
    ("sphere", "FX"),
    ("set", "FX"),
    ("at", "RG"),
    ("join", "AT"),
    ("within", "AT"),
];

/// Deeper nesting is refused, so that no text can exhaust the stack.
const DEEPEST: usize = 64;
/// More bodies are refused: a chain of joins is as deep as its bodies are many.
const MOST_BODIES: usize = 10_000;

/// True for words that cannot stand unquoted as a name.
pub(super) fn is_keyword(word: &str) -> bool {
    ELEMENTS.contains(&word)
}

/// The element that an entry stands in.
fn home_of(word: &str) -> Option<&'static str> {
    let others = ENTRIES.iter().find(|(entry, _)| *entry == word).map(|(_, home)| *home);
    let is_parameter = || Material::PARAMETERS.iter().any(|parameter| parameter.name == word);
    others.or_else(|| is_parameter().then_some("MT"))
}

/// True for words that begin an entry of an element.
pub(super) fn is_entry(word: &str) -> bool {
    home_of(word).is_some() || ["fixed", "angle"].contains(&word)
}

impl Document {
    /// Parses a model file's text; `path` is where it came from, for errors and mesh files.
    ///
    /// # Errors
    /// Everything that is wrong with the text, in one go.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ModelError> {
        let source = Arc::new(Source { path: path.to_owned(), text: text.to_owned() });
        let (tokens, errors) = tokens(&source);
        let count = |wanted: fn(&Token) -> bool| {
            tokens.iter().filter(|(token, _)| wanted(token)).count() as isize
        };
        let surplus = count(|token| matches!(token, Token::Close(_)))
            - count(|token| matches!(token, Token::Open(_)));
        // A quote without end may have swallowed brackets: then their number says nothing.
        let surplus = if errors.is_empty() { surplus } else { 0 };
        let mut parser = Parser {
            source: &source,
            tokens,
            position: 0,
            kinds_matter: surplus == 0 && errors.is_empty(),
            errors,
            surplus,
            body_count: 0,
            names: HashMap::new(),
        };
        let document = parser.document();
        let errors = parser.errors;
        match document {
            Some((unit, gravity, root)) if errors.is_empty() => {
                Ok(Self { unit, gravity, root, source })
            }
            _ => Err(ModelError::new(source, errors)),
        }
    }
}

/// What stands next inside a block.
pub(super) enum Item {
    Element(&'static str, Span),
    Close,
    End,
}

pub(super) struct Parser<'a> {
    source: &'a Source,
    tokens: Vec<(Token, Span)>,
    position: usize,
    errors: Vec<Diagnostic>,
    /// Whether a `(` closed by `}` is worth an error: not when brackets are out of balance anyway.
    pub(super) kinds_matter: bool,
    /// Closing brackets less opening ones, of what is not yet reported.
    pub(super) surplus: isize,
    body_count: usize,
    names: HashMap<String, Span>,
}

impl Parser<'_> {
    pub(super) fn peek(&self) -> (&Token, Span) {
        let (token, span) = &self.tokens[self.position];
        (token, *span)
    }

    pub(super) fn peek_word(&self) -> Option<&str> {
        match self.peek().0 {
            Token::Word(word) => Some(word),
            _ => None,
        }
    }

    pub(super) fn advance(&mut self) -> Span {
        let span = self.peek().1;
        if self.position + 1 < self.tokens.len() {
            self.position += 1;
        }
        span
    }

    pub(super) fn error(&mut self, span: Span, message: impl Into<String>) {
        let diagnostic = self.source.diagnostic(span, message, None);
        self.errors.push(diagnostic);
    }

    pub(super) fn error_with_hint(
        &mut self,
        span: Span,
        message: impl Into<String>,
        hint: impl Into<String>,
    ) {
        let diagnostic = self.source.diagnostic(span, message, Some(hint.into()));
        self.errors.push(diagnostic);
    }

    pub(super) fn errors_so_far(&self) -> usize {
        self.errors.len()
    }

    /// The next token as an error shows it.
    pub(super) fn found(&self) -> String {
        match self.peek().0 {
            Token::Word(word) if word.chars().count() > 40 => {
                format!("`{}...`", word.chars().take(40).collect::<String>())
            }
            Token::Word(word) => format!("`{word}`"),
            Token::Quoted(_) => "a quoted text".into(),
            Token::Open(bracket) | Token::Close(bracket) => format!("`{bracket}`"),
            Token::End => "the end of the file".into(),
        }
    }

    fn document(&mut self) -> Option<(Unit, [f64; 3], Block)> {
        let (unit, gravity) = self.header();
        let Item::Element(keyword, span) = self.next_item(&["BRANCH", "TREE"], None) else {
            if self.errors.is_empty() {
                let found = self.found();
                self.error_with_hint(
                    self.peek().1,
                    format!("expected BRANCH or TREE, found {found}"),
                    "a model is one block: TREE{ NE kidney.seg }, or a BRANCH of several TREEs",
                );
            }
            return None;
        };
        let root = self.block(keyword, span, 0);
        match self.peek() {
            (Token::End, _) => {}
            (Token::Close(bracket), span) => {
                let bracket = *bracket;
                self.error_with_hint(
                    span,
                    format!("this `{bracket}` closes nothing"),
                    "every block before it is closed already: remove it",
                );
            }
            (Token::Word(word), span) if ["BRANCH", "TREE"].contains(&word.as_str()) => {
                let message = format!("a second block `{word}` at the top of the model");
                self.error_with_hint(span, message, "join both in one BRANCH{ ... }");
            }
            (Token::Word(word), span) if ["unit", "gravity"].contains(&word.as_str()) => {
                let message = format!("`{word}` stands before the first block");
                self.error_with_hint(span, message, "move it to the top of the file");
            }
            (_, span) => {
                let found = self.found();
                self.error(span, format!("expected the end of the file, found {found}"));
            }
        }
        Some((unit, gravity, root))
    }

    fn header(&mut self) -> (Unit, [f64; 3]) {
        let (mut unit, mut gravity) = (None, None);
        loop {
            let span = self.peek().1;
            let Some(word) = self.peek_word().map(str::to_owned) else { break };
            let keyword = match word.as_str() {
                "unit" | "gravity" => word.clone(),
                _ if near_miss(&word, &ELEMENTS).is_some() => break,
                _ => match near_miss(&word, &["unit", "gravity"]) {
                    Some(meant) => {
                        self.unknown(span, &word, "", Some(meant));
                        meant.to_owned()
                    }
                    None => break,
                },
            };
            self.advance();
            let repeated = if keyword == "unit" { unit.is_some() } else { gravity.is_some() };
            if repeated {
                self.error(span, format!("a second `{keyword}`; a model has one"));
            }
            if keyword == "gravity" {
                let numbers = self.numbers::<3>("gravity", span);
                gravity = gravity.or(Some(numbers.unwrap_or(Document::GRAVITY)));
            } else {
                unit = unit.or(Some(self.unit()));
            }
        }
        (unit.unwrap_or_default(), gravity.unwrap_or(Document::GRAVITY))
    }

    fn unit(&mut self) -> Unit {
        let (found, span) = (self.found(), self.peek().1);
        let word = self.peek_word().unwrap_or_default().to_owned();
        if let Some(unit) = Unit::from_name(&word) {
            self.advance();
            return unit;
        }
        self.error(span, format!("expected a unit (m, dm, cm, mm, um), found {found}"));
        if !word.is_empty() && !is_keyword(&word) {
            self.advance();
        }
        Unit::default()
    }

    fn block(&mut self, keyword: &'static str, span: Span, depth: usize) -> Block {
        if keyword == "TREE" {
            return Block::Tree(Box::new(self.tree(span)));
        }
        if depth == DEEPEST {
            self.error(span, format!("blocks are nested more than {DEEPEST} deep"));
            self.skip_block();
            return Block::Branch(Box::default());
        }
        Block::Branch(Box::new(self.branch(span, depth)))
    }

    fn branch(&mut self, keyword_span: Span, depth: usize) -> Branch {
        let mut branch = Branch::default();
        let opening = self.open("BRANCH", keyword_span);
        let mut seen = Vec::new();
        let errors_before = self.errors.len();
        loop {
            match self.next_item(&IN_BRANCH, Some("BRANCH")) {
                Item::Element(keyword @ ("BRANCH" | "TREE"), span) => {
                    let child = self.block(keyword, span, depth + 1);
                    branch.children.push(child);
                }
                Item::Element("AT", span) => branch.attachments.extend(self.attachment(span)),
                Item::Element(keyword, span) => {
                    if !self.is_region(keyword) {
                        self.once(keyword, span, &mut seen);
                    }
                    self.setting(keyword, span, &mut branch.settings);
                }
                Item::Close if branch.children.is_empty() && self.drop_surplus() => {}
                end => {
                    self.close(&end, opening);
                    break;
                }
            }
        }
        if branch.children.is_empty() && self.errors.len() == errors_before {
            self.error_with_hint(
                keyword_span,
                "this BRANCH is empty",
                "a BRANCH groups one or more TREEs or BRANCHes",
            );
        }
        branch
    }

    fn tree(&mut self, keyword_span: Span) -> Tree {
        let mut tree = Tree { span: keyword_span, ..Tree::default() };
        self.body_count += 1;
        if self.body_count == MOST_BODIES + 1 {
            self.error(keyword_span, format!("more than {MOST_BODIES} bodies in one model"));
        }
        tree.name = self.tree_name();
        let opening = self.open("TREE", keyword_span);
        let mut seen = Vec::new();
        let errors_before = self.errors.len();
        loop {
            if let Some("BRANCH" | "TREE") = self.peek_word() {
                if self.block_in_tree(opening) {
                    break;
                }
                continue;
            }
            match self.next_item(&IN_TREE, Some("TREE")) {
                Item::Element(keyword, span) => {
                    if keyword != "FX" && !self.is_region(keyword) {
                        self.once(keyword, span, &mut seen);
                    }
                    self.tree_element(keyword, span, &mut tree);
                }
                Item::Close if !seen.contains(&"NE") && self.drop_surplus() => {}
                end => {
                    self.close(&end, opening);
                    break;
                }
            }
        }
        if !seen.contains(&"NE") && self.errors.len() == errors_before {
            self.error_with_hint(
                keyword_span,
                "this TREE names no object data",
                "write NE and its mesh file, such as NE kidney.seg",
            );
        }
        tree
    }

    fn tree_name(&mut self) -> Option<String> {
        let (name, span) = match self.peek() {
            (Token::Word(word), span) if !is_keyword(word) => (word.clone(), span),
            (Token::Quoted(text), span) => (text.clone(), span),
            _ => return None,
        };
        // Without a bracket after it, it is rather an element than a name.
        if !matches!(self.tokens[self.position + 1].0, Token::Open(_)) {
            return None;
        }
        self.advance();
        if self.names.insert(name.clone(), span).is_some() {
            self.error(span, format!("a second TREE named `{name}`; names are unique"));
        }
        Some(name)
    }

    fn tree_element(&mut self, keyword: &'static str, span: Span, tree: &mut Tree) {
        match keyword {
            "PE" => tree.processor = self.processor(span),
            "NE" => {
                if let Some((file, file_span)) = self.file(span) {
                    (tree.file, tree.file_span) = (file, file_span);
                }
            }
            "FX" => self.fixed(span, &mut tree.fixed),
            "RG" => tree.rigid = Some(self.rigid(span)),
            "IV" => tree.initial_velocity = self.numbers::<3>("IV", span),
            _ => self.setting(keyword, span, &mut tree.settings),
        }
    }

    fn setting(&mut self, keyword: &'static str, span: Span, settings: &mut Settings) {
        match keyword {
            "ME" => settings.transform = Some(self.transform(span)),
            "MT" if self.is_region(keyword) => self.region_material(span, &mut settings.regions),
            "MT" => settings.material = self.material(span),
            "CN" => settings.contact = self.contact(span),
            _ => settings.appearance = self.appearance(span),
        }
    }

    /// Whether the element is an MT of one region; those may come more than once.
    fn is_region(&self, keyword: &str) -> bool {
        keyword == "MT" && self.peek_word() == Some("region")
    }

    /// A TREE cannot hold blocks. True when its closing bracket is what is missing.
    fn block_in_tree(&mut self, opening: Opening) -> bool {
        let (found, span) = (self.found(), self.peek().1);
        if self.surplus < 0 {
            self.surplus += 1;
            self.error(
                opening.span,
                format!("this TREE is not closed before the next {}", found.trim_matches('`')),
            );
            return true;
        }
        self.error_with_hint(
            span,
            format!("{found} stands in a TREE, which holds one organ"),
            "close the TREE before it, and join both in a BRANCH",
        );
        self.advance();
        self.skip_block();
        false
    }

    fn once(&mut self, keyword: &'static str, span: Span, seen: &mut Vec<&'static str>) {
        if seen.contains(&keyword) {
            self.error(span, format!("a second {keyword} in this block; it may stand once"));
        } else {
            seen.push(keyword);
        }
    }

    /// The next element of `allowed`; everything else on the way is reported and skipped.
    fn next_item(&mut self, allowed: &[&'static str], block: Option<&str>) -> Item {
        loop {
            let span = self.peek().1;
            let word = match self.peek().0 {
                Token::End => return Item::End,
                Token::Close(_) => return Item::Close,
                Token::Open(_) | Token::Quoted(_) => {
                    let (found, expected) = (self.found(), allowed.join(", "));
                    self.error(span, format!("expected one of {expected}, found {found}"));
                    self.skip_to_element();
                    continue;
                }
                Token::Word(word) => word.clone(),
            };
            self.advance();
            if let Some(keyword) = allowed.iter().find(|&&keyword| keyword == word) {
                return Item::Element(keyword, span);
            }
            let home = home_of(&word);
            if is_keyword(&word) {
                let message = match block {
                    Some(block) => format!("{word} does not stand in a {block}"),
                    None => format!("{word} stands in a TREE, not at the top of the model"),
                };
                self.error(span, message);
            } else if let Some(home) = home {
                let hint = format!("write {home}{{ {word} ... }}");
                self.error_with_hint(span, format!("`{word}` belongs into {home}"), hint);
            } else {
                let meant = near_miss(&word, allowed);
                self.unknown(span, &word, &allowed.join(", "), meant);
                if let Some(meant) = meant {
                    return Item::Element(meant, span);
                }
            }
            self.skip_to_element();
        }
    }

    /// Reports a word that is no keyword here.
    pub(super) fn unknown(&mut self, span: Span, word: &str, expected: &str, meant: Option<&str>) {
        let shown: String = word.chars().take(40).collect();
        match meant {
            Some(meant) => {
                self.error_with_hint(
                    span,
                    format!("unknown word `{shown}`"),
                    format!("{shown}: did you mean {meant}?"),
                );
            }
            None => self.error_with_hint(
                span,
                format!("unknown word `{shown}`"),
                format!("expected one of {expected}"),
            ),
        }
    }
}
