//! Near misses: which keyword was meant.

/// The one candidate that `word` is a misspelling of, if there is exactly one.
pub(super) fn near_miss<'a>(word: &str, candidates: &[&'a str]) -> Option<&'a str> {
    if let Some(same) = candidates.iter().find(|candidate| candidate.eq_ignore_ascii_case(word)) {
        return Some(same);
    }
    let limit = if word.chars().count() <= 4 { 1 } else { 2 };
    let distances = || candidates.iter().map(|candidate| (distance(word, candidate), *candidate));
    let best = distances().map(|(distance, _)| distance).min().filter(|&best| best <= limit)?;
    let mut nearest = distances().filter(|&(distance, _)| distance == best);
    let (_, candidate) = nearest.next()?;
    nearest.next().is_none().then_some(candidate)
}

/// Edits between two words: insertion, deletion, replacement, swap of neighbours.
fn distance(left: &str, right: &str) -> usize {
    let (left, right): (Vec<char>, Vec<char>) = (left.chars().collect(), right.chars().collect());
    if left.len().abs_diff(right.len()) > 2 {
        return usize::MAX;
    }
    let mut before: Vec<usize> = Vec::new();
    let mut above: Vec<usize> = (0..=right.len()).collect();
    for i in 1..=left.len() {
        let mut row = vec![i];
        for j in 1..=right.len() {
            let replaced = above[j - 1] + usize::from(left[i - 1] != right[j - 1]);
            let mut best = replaced.min(above[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && left[i - 1] == right[j - 2] && left[i - 2] == right[j - 1] {
                best = best.min(before[j - 2] + 1);
            }
            row.push(best);
        }
        before = std::mem::replace(&mut above, row);
    }
    above[right.len()]
}

#[cfg(test)]
mod tests {
    use super::near_miss;

    #[test]
    fn misspellings_find_their_word_and_ambiguous_ones_do_not() {
        let elements = ["BRANCH", "TREE", "ME", "PE", "NE", "MT"];
        for (word, meant) in [
            ("PEE", Some("PE")),
            ("pe", Some("PE")),
            ("Tree", Some("TREE")),
            ("TRE", Some("TREE")),
            ("BRNACH", Some("BRANCH")),
            ("XE", None),
            ("kidney.seg", None),
            ("", None),
        ] {
            assert_eq!(near_miss(word, &elements), meant, "{word}");
        }
        assert_eq!(near_miss("trasn", &["trans", "rot", "scale"]), Some("trans"));
    }
}
