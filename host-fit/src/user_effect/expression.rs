//! Compilation of an expression in Rust syntax to a [`Program`](super::program::Program): a small safe subset
//! is allowed, the rest is rejected with its column.

use super::program::{Binary, Builder, Line, Lines, Op, Register, Unary};
use proc_macro2::{Delimiter, Span, TokenStream, TokenTree};
use std::str::FromStr;
use syn::parse::Parser;
use syn::spanned::Spanned;
use syn::{BinOp, Block, Expr, Lit, Pat, Stmt, UnOp};

/// Longest expression, tokens: limits nesting depth and cost per sample.
const MOST_TOKENS: usize = 400;
/// Deepest nesting of brackets.
const DEEPEST: usize = 32;
/// Punctuation of the subset.
const PUNCTUATION: &str = "+-*/<>=!&|,;.";
/// The subset in words, for error messages.
const SUBSET: &str = "allowed are numbers, names, + - * /, comparisons, && || !, `if … else …`, \
     `let`, and abs, min, max, sqrt, exp, cbrt, sin, cos, delayed, table";

/// A problem of an expression, with its position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Fault {
    /// Line of the expression, from 1.
    pub(super) line: usize,
    /// Column, in characters from 1.
    pub(super) column: usize,
    pub(super) problem: String,
}

impl Fault {
    fn at(span: Span, problem: impl Into<String>) -> Self {
        let start = span.start();
        Self {
            line: start.line.max(1),
            column: start.column + 1,
            problem: problem.into(),
        }
    }
}

/// Meaning of a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    /// An operation without operands.
    Read(Op),
    /// A result.
    Value(Typed),
}

/// A result with its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Typed {
    pub(super) register: Register,
    pub(super) kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Number,
    Condition,
}

impl Kind {
    fn in_words(self) -> &'static str {
        match self {
            Self::Number => "a number",
            Self::Condition => "a condition",
        }
    }
}

/// Compiles expressions one after the other into one list of operations.
#[derive(Debug, Default)]
pub(super) struct Compiler {
    pub(super) builder: Builder,
    /// Names in scope, the innermost last.
    pub(super) names: Vec<(String, Meaning)>,
}

impl Compiler {
    /// The register that holds the value of `text`, a number.
    pub(super) fn number(&mut self, text: &str) -> Result<Register, Fault> {
        let tokens = TokenStream::from_str(text).map_err(|error| {
            Fault::at(
                error.span(),
                "this is not valid Rust syntax; look for an unclosed bracket or quote",
            )
        })?;
        check_tokens(&tokens)?;
        let statements = Block::parse_within
            .parse2(tokens)
            .map_err(|error| Fault::at(error.span(), format!("Rust's grammar says: {error}")))?;
        let known = self.names.len();
        let whole = Span::call_site();
        let result = self.statements(&statements, whole);
        self.names.truncate(known);
        expect(
            result?,
            Kind::Number,
            statements.last().map_or(whole, Spanned::span),
        )
    }

    fn statements(&mut self, statements: &[Stmt], place: Span) -> Result<Typed, Fault> {
        let Some((last, before)) = statements.split_last() else {
            return Err(Fault::at(
                place,
                "a value is missing here; write an expression",
            ));
        };
        for statement in before {
            self.binding(statement)?;
        }
        match last {
            Stmt::Expr(value, None) => self.value(value),
            Stmt::Expr(value, Some(_)) => Err(Fault::at(
                value.span(),
                "the last line is the value and must not end with a semicolon",
            )),
            Stmt::Local(local) => Err(Fault::at(
                local.span(),
                "after `let` lines there must be a value",
            )),
            Stmt::Item(_) | Stmt::Macro(_) => Err(outside(last)),
        }
    }

    fn binding(&mut self, statement: &Stmt) -> Result<(), Fault> {
        let local = match statement {
            Stmt::Local(local) => local,
            Stmt::Expr(value, _) => {
                let problem = "this value is not used; write `let name = …;`, and put an \
                     `if … else …` that is part of a sum or product in parentheses";
                return Err(Fault::at(value.span(), problem));
            }
            Stmt::Item(_) | Stmt::Macro(_) => return Err(outside(statement)),
        };
        let (Pat::Ident(pattern), Some(init), None) = (
            &local.pat,
            &local.init,
            local.init.as_ref().and_then(|init| init.diverge.as_ref()),
        ) else {
            return Err(Fault::at(local.span(), "write `let name = value;`"));
        };
        if pattern.mutability.is_some() || pattern.by_ref.is_some() || pattern.subpat.is_some() {
            return Err(Fault::at(local.span(), "write `let name = value;`"));
        }
        let name = pattern.ident.to_string();
        if self.names.iter().any(|(known, _)| *known == name) {
            let problem = format!("`{name}` is already defined; choose another name");
            return Err(Fault::at(pattern.ident.span(), problem));
        }
        let value = self.value(&init.expr)?;
        self.names.push((name, Meaning::Value(value)));
        Ok(())
    }

    fn block(&mut self, block: &Block) -> Result<Typed, Fault> {
        let known = self.names.len();
        let value = self.statements(&block.stmts, block.brace_token.span.open());
        self.names.truncate(known);
        value
    }

    fn value(&mut self, expr: &Expr) -> Result<Typed, Fault> {
        match expr {
            Expr::Paren(inner) => self.value(&inner.expr),
            Expr::Block(inner) if inner.label.is_none() => self.block(&inner.block),
            Expr::Lit(literal) => self.literal(&literal.lit),
            Expr::Path(path) => {
                let name = path.path.get_ident().filter(|_| path.qself.is_none());
                let name = name.ok_or_else(|| outside(expr))?;
                self.name(&name.to_string(), name.span())
            }
            Expr::Unary(unary) => {
                let (f, kind) = match unary.op {
                    UnOp::Neg(_) => (Unary::Negative, Kind::Number),
                    UnOp::Not(_) => (Unary::Not, Kind::Condition),
                    _ => return Err(outside(expr)),
                };
                let x = self.of_kind(&unary.expr, kind)?;
                Ok(self.push(Op::Unary(f, x), kind))
            }
            Expr::Binary(binary) => {
                let (f, operands, result) =
                    binary_operator(&binary.op).ok_or_else(|| outside(&binary.op))?;
                let x = self.of_kind(&binary.left, operands)?;
                let y = self.of_kind(&binary.right, operands)?;
                Ok(self.push(Op::Binary(f, x, y), result))
            }
            Expr::If(choice) => {
                let condition = self.of_kind(&choice.cond, Kind::Condition)?;
                let Some((_, otherwise)) = &choice.else_branch else {
                    let problem = "an `if` needs an `else` here: it must always have a value";
                    return Err(Fault::at(choice.if_token.span, problem));
                };
                let then = self.block(&choice.then_branch)?;
                let place = otherwise.span();
                let otherwise = self.value(otherwise)?;
                let otherwise = expect(otherwise, then.kind, place)?;
                let op = Op::Select(condition, then.register, otherwise);
                Ok(self.push(op, then.kind))
            }
            Expr::Call(call) => {
                let name = match &*call.func {
                    Expr::Path(path) => path.path.get_ident(),
                    _ => None,
                };
                let name = name.ok_or_else(|| outside(&call.func))?;
                let arguments: Vec<&Expr> = call.args.iter().collect();
                self.call(&name.to_string(), name.span(), &arguments)
            }
            Expr::MethodCall(call) if call.turbofish.is_none() => {
                let mut arguments = vec![&*call.receiver];
                arguments.extend(&call.args);
                self.call(&call.method.to_string(), call.method.span(), &arguments)
            }
            _ => Err(outside(expr)),
        }
    }

    fn push(&mut self, op: Op, kind: Kind) -> Typed {
        Typed {
            register: self.builder.push(op),
            kind,
        }
    }

    fn of_kind(&mut self, expr: &Expr, kind: Kind) -> Result<Register, Fault> {
        let value = self.value(expr)?;
        expect(value, kind, expr.span())
    }

    fn literal(&mut self, literal: &Lit) -> Result<Typed, Fault> {
        let (digits, suffix) = match literal {
            Lit::Int(int) => (int.base10_digits(), int.suffix()),
            Lit::Float(float) => (float.base10_digits(), float.suffix()),
            _ => return Err(outside(literal)),
        };
        if !suffix.is_empty() {
            let problem = format!("write the number without `{suffix}`; all numbers are real");
            return Err(Fault::at(literal.span(), problem));
        }
        let value: f64 = digits.parse().unwrap_or(f64::NAN);
        if !(value as f32).is_finite() {
            let problem = "this number is beyond single precision, in which the board calculates";
            return Err(Fault::at(literal.span(), problem));
        }
        Ok(self.push(Op::Number(value), Kind::Number))
    }

    fn name(&mut self, name: &str, span: Span) -> Result<Typed, Fault> {
        let known = self.names.iter().rev().find(|(known, _)| known == name);
        match known.map(|(_, meaning)| *meaning) {
            Some(Meaning::Value(value)) => Ok(value),
            Some(Meaning::Read(op)) => Ok(self.push(op, Kind::Number)),
            None => {
                let names: Vec<&str> = self.names.iter().map(|(name, _)| name.as_str()).collect();
                let problem = format!(
                    "`{name}` is not defined here; the defined names are {}",
                    names.join(", ")
                );
                Err(Fault::at(span, problem))
            }
        }
    }

    fn call(&mut self, name: &str, span: Span, arguments: &[&Expr]) -> Result<Typed, Fault> {
        let mut numbers = Vec::with_capacity(arguments.len());
        for argument in arguments {
            numbers.push(self.of_kind(argument, Kind::Number)?);
        }
        if name == "table" {
            return self.table(span, arguments, &numbers);
        }
        let unary = match name {
            "abs" => Some(Unary::Abs),
            "sqrt" => Some(Unary::Sqrt),
            "exp" => Some(Unary::Exp),
            "cbrt" => Some(Unary::Cbrt),
            "sin" => Some(Unary::Sin),
            "cos" => Some(Unary::Cos),
            _ => None,
        };
        let expected = match (name, unary) {
            (_, Some(_)) => 1,
            ("delayed", None) if numbers.len() == 3 => 3,
            ("min" | "max" | "delayed", None) => 2,
            _ => {
                let problem = format!("there is no function `{name}`: {SUBSET}");
                return Err(Fault::at(span, problem));
            }
        };
        let op = match (unary, numbers.as_slice()) {
            (Some(f), &[x]) => Op::Unary(f, x),
            (None, &[x, y]) if name == "min" => Op::Binary(Binary::Min, x, y),
            (None, &[x, y]) if name == "max" => Op::Binary(Binary::Max, x, y),
            (None, &[signal, delay, ref longest @ ..]) => {
                let place = |i: usize| arguments.get(i).map_or(span, |delay| delay.span());
                let longest = longest.first().copied();
                if longest.is_none() && !self.builder.is_once(delay) {
                    let problem = "a delay of two arguments must be constant: a number of seconds, a \
                         parameter, or an expression of those and `period`; for a varying delay state its \
                         longest value: delayed(x, seconds, longest)";
                    return Err(Fault::at(place(1), problem));
                }
                if longest.is_some_and(|longest| !self.builder.is_once(longest)) {
                    let problem = "the longest delay must be a constant number of seconds";
                    return Err(Fault::at(place(2), problem));
                }
                if self.builder.is_number(signal) {
                    let problem = "a number is constant, so it cannot be delayed";
                    return Err(Fault::at(span, problem));
                }
                let register = self.builder.delayed(signal, delay, longest);
                let kind = Kind::Number;
                return Ok(Typed { register, kind });
            }
            _ => {
                let found = numbers.len();
                let problem = format!("`{name}` takes {expected} argument(s), here are {found}");
                return Err(Fault::at(span, problem));
            }
        };
        Ok(self.push(op, Kind::Number))
    }

    /// `table(x, x1, v1, x2, v2, …)`: linear between points, constant outside.
    fn table(
        &mut self,
        span: Span,
        arguments: &[&Expr],
        numbers: &[Register],
    ) -> Result<Typed, Fault> {
        let [x, points @ ..] = numbers else {
            return Err(Fault::at(span, TABLE));
        };
        if points.len() < 4 || !points.len().is_multiple_of(2) {
            return Err(Fault::at(span, TABLE));
        }
        let mut value = points[1];
        let mut lines = Vec::new();
        for (i, pair) in points.windows(4).step_by(2).enumerate() {
            let (from, to) = (self.builder.number(pair[0]), self.builder.number(pair[2]));
            // The points must differ in single precision, in which the board calculates.
            let width = from
                .zip(to)
                .map(|(from, to)| (to - from, to as f32 > from as f32));
            let (Some((width, true)), Some(to)) = (width, to) else {
                let place = arguments.get(2 * i + 3).map_or(span, |x| x.span());
                let problem = "the positions of a table must be numbers in ascending order";
                return Err(Fault::at(place, problem));
            };
            let mut number = |op: Op| self.builder.push(op);
            let (zero, one) = (number(Op::Number(0.0)), number(Op::Number(1.0)));
            let steepness = number(Op::Number(1.0 / width));
            let along = number(Op::Binary(Binary::Subtract, *x, pair[0]));
            let along = number(Op::Binary(Binary::Multiply, along, steepness));
            let along = number(Op::Binary(Binary::Max, along, zero));
            let along = number(Op::Binary(Binary::Min, along, one));
            let rise = number(Op::Binary(Binary::Subtract, pair[3], pair[1]));
            let part = number(Op::Binary(Binary::Multiply, along, rise));
            value = number(Op::Binary(Binary::Add, value, part));
            lines.push(Line {
                from: pair[0],
                to,
                steepness,
                rise,
                value,
            });
        }
        self.builder.is_table(Lines {
            x: *x,
            first: points[1],
            lines,
        });
        let kind = Kind::Number;
        Ok(Typed {
            register: value,
            kind,
        })
    }
}

/// Syntax of a table.
const TABLE: &str = "a table is written table(x, x1, v1, x2, v2, …): at least two points, with positions that \
     are numbers in ascending order";

fn binary_operator(op: &BinOp) -> Option<(Binary, Kind, Kind)> {
    use Kind::{Condition, Number};
    Some(match op {
        BinOp::Add(_) => (Binary::Add, Number, Number),
        BinOp::Sub(_) => (Binary::Subtract, Number, Number),
        BinOp::Mul(_) => (Binary::Multiply, Number, Number),
        BinOp::Div(_) => (Binary::Divide, Number, Number),
        BinOp::Lt(_) => (Binary::Less, Number, Condition),
        BinOp::Le(_) => (Binary::LessOrEqual, Number, Condition),
        BinOp::Gt(_) => (Binary::Greater, Number, Condition),
        BinOp::Ge(_) => (Binary::GreaterOrEqual, Number, Condition),
        BinOp::Eq(_) => (Binary::Equal, Number, Condition),
        BinOp::Ne(_) => (Binary::Unequal, Number, Condition),
        BinOp::And(_) => (Binary::And, Condition, Condition),
        BinOp::Or(_) => (Binary::Or, Condition, Condition),
        _ => return None,
    })
}

fn expect(value: Typed, kind: Kind, place: Span) -> Result<Register, Fault> {
    if value.kind == kind {
        return Ok(value.register);
    }
    let problem = format!(
        "{} is needed here, but this is {}",
        kind.in_words(),
        value.kind.in_words()
    );
    Err(Fault::at(place, problem))
}

fn outside(what: &impl Spanned) -> Fault {
    Fault::at(
        what.span(),
        format!("this is outside the language of effects: {SUBSET}"),
    )
}

/// Rejects tokens outside the subset before the Rust parser sees them: attributes, types, lifetimes, and
/// nesting that exhausts the stack.
fn check_tokens(tokens: &TokenStream) -> Result<(), Fault> {
    let mut count = 0;
    let mut open = vec![tokens.clone().into_iter()];
    while let Some(level) = open.last_mut() {
        let Some(token) = level.next() else {
            open.pop();
            continue;
        };
        count += 1;
        let span = token.span();
        if count > MOST_TOKENS {
            let problem =
                format!("the expression is too long: more than {MOST_TOKENS} words and signs");
            return Err(Fault::at(span, problem));
        }
        match token {
            TokenTree::Group(group) => {
                if !matches!(group.delimiter(), Delimiter::Parenthesis | Delimiter::Brace) {
                    return Err(Fault::at(span, format!("no brackets `[` here: {SUBSET}")));
                }
                if open.len() > DEEPEST {
                    let problem = format!("brackets are nested deeper than {DEEPEST}; use `let`");
                    return Err(Fault::at(span, problem));
                }
                open.push(group.stream().into_iter());
            }
            TokenTree::Punct(sign) if !PUNCTUATION.contains(sign.as_char()) => {
                let problem = format!(
                    "`{}` is outside the language of effects: {SUBSET}",
                    sign.as_char()
                );
                return Err(Fault::at(span, problem));
            }
            TokenTree::Ident(word) => {
                let word = word.to_string();
                let keyword = syn::parse_str::<syn::Ident>(&word).is_err();
                if keyword && !matches!(word.as_str(), "if" | "else" | "let") {
                    let problem = format!("`{word}` is outside the language of effects: {SUBSET}");
                    return Err(Fault::at(span, problem));
                }
            }
            TokenTree::Punct(_) | TokenTree::Literal(_) => {}
        }
    }
    Ok(())
}
