//! Expands macros by example, so that their declarations and names are found.

use proc_macro2::{Delimiter, Group, Ident, TokenStream, TokenTree};
use quote::ToTokens;
use std::collections::HashMap;
use syn::ext::IdentExt;
use syn::parse::discouraged::Speculative;
use syn::parse::{ParseStream, Parser};
use syn::{
    Block, Expr, Item, Lifetime, Lit, Meta, Pat, Path, Result, Stmt, Token, Type, Visibility,
};

/// A `macro_rules!`: matchers with their transcribers.
pub struct Macro(Vec<(Vec<Pattern>, Vec<Pattern>)>);

enum Pattern {
    Token(TokenTree),
    Group(Delimiter, Vec<Pattern>),
    Variable { name: String, fragment: String },
    Repeat { inner: Vec<Pattern>, separator: Vec<Pattern>, operator: char },
}

enum Value {
    One(TokenStream),
    Many(Vec<Value>),
}

impl Macro {
    /// Parses the rules. `$crate` becomes `crate`.
    pub fn new(rules: TokenStream) -> Result<Self> {
        let parse = |input: ParseStream| {
            let mut rules = Vec::new();
            while !input.is_empty() {
                let matcher: Group = input.parse()?;
                input.parse::<Token![=>]>()?;
                let transcriber: Group = input.parse()?;
                input.parse::<Option<Token![;]>>()?;
                let matcher = patterns(matcher.stream(), true);
                rules.push((matcher, patterns(transcriber.stream(), false)));
            }
            Ok(Self(rules))
        };
        parse.parse2(rules)
    }

    /// Expands an invocation with the first matching rule.
    pub fn expand(&self, input: &TokenStream) -> Option<TokenStream> {
        self.0.iter().find_map(|(matcher, transcriber)| {
            let mut values = HashMap::new();
            let parse = |input: ParseStream| take(matcher, input, &mut values);
            parse.parse2(input.clone()).ok()?;
            let values = values.iter().map(|(name, value)| (name.as_str(), value)).collect();
            Some(transcribe(transcriber, &values))
        })
    }
}

fn patterns(tokens: TokenStream, matcher: bool) -> Vec<Pattern> {
    let inner = |group: Group| patterns(group.stream(), matcher);
    let mut tokens = tokens.into_iter();
    let mut patterns = Vec::new();
    while let Some(token) = tokens.next() {
        patterns.push(match token {
            TokenTree::Group(group) => Pattern::Group(group.delimiter(), inner(group)),
            TokenTree::Punct(dollar) if dollar.as_char() == '$' => match tokens.next() {
                Some(TokenTree::Group(group)) => {
                    let mut separator = Vec::new();
                    let operator = loop {
                        match tokens.next() {
                            Some(TokenTree::Punct(p)) if "*+?".contains(p.as_char()) => {
                                break p.as_char();
                            }
                            other => separator.extend(other.map(Pattern::Token)),
                        }
                    };
                    Pattern::Repeat { inner: inner(group), separator, operator }
                }
                Some(TokenTree::Ident(name)) if name == "crate" => Pattern::Token(name.into()),
                name => {
                    let fragment = matcher.then(|| tokens.nth(1)).flatten();
                    Pattern::Variable { name: text(name), fragment: text(fragment) }
                }
            },
            other => Pattern::Token(other),
        });
    }
    patterns
}

fn text(token: Option<TokenTree>) -> String {
    token.map_or(String::new(), |token| token.to_string())
}

/// Matches `input` with `patterns`, and stores the values of their variables.
fn take(
    patterns: &[Pattern],
    input: ParseStream,
    values: &mut HashMap<String, Value>,
) -> Result<()> {
    for pattern in patterns {
        match pattern {
            Pattern::Token(token) => {
                if input.parse::<TokenTree>()?.to_string() != token.to_string() {
                    return Err(input.error("another token"));
                }
            }
            Pattern::Group(delimiter, inner) => {
                let group: Group = input.parse()?;
                if group.delimiter() != *delimiter {
                    return Err(input.error("another delimiter"));
                }
                let parse = |input: ParseStream| take(inner, input, values);
                parse.parse2(group.stream())?;
            }
            Pattern::Variable { name, fragment } => {
                values.insert(name.clone(), Value::One(take_fragment(fragment, input)?));
            }
            Pattern::Repeat { inner, separator, operator } => {
                let mut names = Vec::new();
                variables(inner, &mut names);
                let mut rounds = Vec::new();
                while rounds.is_empty() || *operator != '?' {
                    let fork = input.fork();
                    let mut round = HashMap::new();
                    let separator = if rounds.is_empty() { &[][..] } else { separator };
                    if take(separator, &fork, &mut round).is_err()
                        || take(inner, &fork, &mut round).is_err()
                        || fork.cursor() == input.cursor()
                    {
                        break;
                    }
                    input.advance_to(&fork);
                    rounds.push(round);
                }
                if *operator == '+' && rounds.is_empty() {
                    return Err(input.error("not even once"));
                }
                for name in names {
                    let all = rounds.iter_mut().filter_map(|round| round.remove(name)).collect();
                    values.insert(name.to_string(), Value::Many(all));
                }
            }
        }
    }
    Ok(())
}

fn variables<'p>(patterns: &'p [Pattern], names: &mut Vec<&'p str>) {
    for pattern in patterns {
        match pattern {
            Pattern::Token(_) => {}
            Pattern::Variable { name, .. } => names.push(name),
            Pattern::Group(_, inner) | Pattern::Repeat { inner, .. } => variables(inner, names),
        }
    }
}

fn take_fragment(fragment: &str, input: ParseStream) -> Result<TokenStream> {
    Ok(match fragment {
        "block" => input.parse::<Block>()?.into_token_stream(),
        "expr" => input.parse::<Expr>()?.into_token_stream(),
        "ident" => Ident::parse_any(input)?.into_token_stream(),
        "item" => input.parse::<Item>()?.into_token_stream(),
        "lifetime" => input.parse::<Lifetime>()?.into_token_stream(),
        "literal" => input.parse::<Lit>()?.into_token_stream(),
        "meta" => input.parse::<Meta>()?.into_token_stream(),
        "pat" => Pat::parse_multi_with_leading_vert(input)?.into_token_stream(),
        "path" => input.parse::<Path>()?.into_token_stream(),
        "stmt" => input.parse::<Stmt>()?.into_token_stream(),
        "ty" => input.parse::<Type>()?.into_token_stream(),
        "vis" => input.parse::<Visibility>()?.into_token_stream(),
        _ => input.parse::<TokenTree>()?.into_token_stream(),
    })
}

fn transcribe(patterns: &[Pattern], values: &HashMap<&str, &Value>) -> TokenStream {
    let mut tokens = TokenStream::new();
    for pattern in patterns {
        match pattern {
            Pattern::Token(token) => tokens.extend([token.clone()]),
            Pattern::Group(delimiter, inner) => {
                tokens.extend([TokenTree::from(Group::new(*delimiter, transcribe(inner, values)))]);
            }
            Pattern::Variable { name, .. } => {
                if let Some(Value::One(value)) = values.get(name.as_str()) {
                    tokens.extend(value.clone());
                }
            }
            Pattern::Repeat { inner, separator, .. } => {
                let mut names = Vec::new();
                variables(inner, &mut names);
                let rounds = names.iter().filter_map(|name| match values.get(name) {
                    Some(Value::Many(rounds)) => Some((*name, rounds)),
                    _ => None,
                });
                let rounds: Vec<_> = rounds.collect();
                for index in 0..rounds.iter().map(|(_, values)| values.len()).max().unwrap_or(0) {
                    let mut values = values.clone();
                    for (name, rounds) in &rounds {
                        values.extend(rounds.get(index).map(|value| (*name, value)));
                    }
                    let separator = if index == 0 { &[][..] } else { separator };
                    tokens.extend(transcribe(separator, &values));
                    tokens.extend(transcribe(inner, &values));
                }
            }
        }
    }
    tokens
}
