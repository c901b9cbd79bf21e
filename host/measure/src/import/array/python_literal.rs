//! Literals of Python as the header of a NumPy file has them: dictionaries, tuples, lists, texts, integers, truth values.

/// A literal.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Literal {
    Text(String),
    Integer(usize),
    Truth(bool),
    /// A list or a tuple.
    List(Vec<Literal>),
    Dictionary(Vec<(Literal, Literal)>),
}

/// Nesting that no header has.
const MAX_DEPTH: usize = 8;

/// The literal that a text is; `None` of another text.
pub(super) fn parse(text: &str) -> Option<Literal> {
    let mut rest = text;
    let literal = value(&mut rest, 0)?;
    rest.trim().is_empty().then_some(literal)
}

impl Literal {
    /// The value of a key of a dictionary.
    pub(super) fn get(&self, key: &str) -> Option<&Self> {
        let Self::Dictionary(pairs) = self else { return None };
        pairs.iter().find(|(own, _)| *own == Self::Text(key.into())).map(|(_, value)| value)
    }
}

fn value(rest: &mut &str, depth: usize) -> Option<Literal> {
    *rest = rest.trim_start();
    let first = rest.chars().next().filter(|_| depth < MAX_DEPTH)?;
    match first {
        '\'' | '"' => {
            let (text, behind) = rest[1..].split_once(first)?;
            *rest = behind;
            Some(Literal::Text(text.into()))
        }
        '(' | '[' => {
            let close = if first == '(' { ')' } else { ']' };
            items(rest, close, &mut |rest| value(rest, depth + 1)).map(Literal::List)
        }
        '{' => {
            let mut pair = |rest: &mut &str| {
                let key = value(rest, depth + 1)?;
                *rest = rest.trim_start().strip_prefix(':')?;
                Some((key, value(rest, depth + 1)?))
            };
            items(rest, '}', &mut pair).map(Literal::Dictionary)
        }
        _ => {
            let length = rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
            let (word, behind) = rest.split_at(length);
            *rest = behind;
            match word {
                "True" => Some(Literal::Truth(true)),
                "False" => Some(Literal::Truth(false)),
                // Python 2 wrote long integers with an L.
                _ => word.trim_end_matches('L').parse().ok().map(Literal::Integer),
            }
        }
    }
}

/// What is between an opening character and `close`, separated by commas.
fn items<T>(rest: &mut &str, close: char, item: &mut dyn FnMut(&mut &str) -> Option<T>) -> Option<Vec<T>> {
    *rest = &rest[1..];
    let mut all = Vec::new();
    loop {
        *rest = rest.trim_start();
        if let Some(behind) = rest.strip_prefix(close) {
            *rest = behind;
            return Some(all);
        }
        all.push(item(rest)?);
        *rest = rest.trim_start();
        match rest.strip_prefix(',') {
            Some(behind) => *rest = behind,
            None if rest.starts_with(close) => {}
            None => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_parsed_and_other_texts_are_not() {
        let header =
            parse("{'descr': [('t', '<f8'), ('q', '<f4', (3,))], 'fortran_order': False, 'shape': (5,), }  \n");
        let header = header.unwrap();
        assert_eq!(header.get("fortran_order"), Some(&Literal::Truth(false)));
        assert_eq!(header.get("shape"), Some(&Literal::List(vec![Literal::Integer(5)])));
        for wrong in ["", "{", "{'a'}", "(1 2)", "[1", "{'a': }", "'open", "[[[[[[[[[[1]]]]]]]]]]", "ä"] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }
}
