//! Line numbers of rows.

/// The line of each row in a file, from 1. Rows mostly follow each other: the lines are stored as runs of consecutive
/// ones.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lines {
    /// First row and line of each run.
    runs: Vec<(usize, u64)>,
    rows: usize,
}

impl Lines {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// The line of a row.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn get(&self, row: usize) -> u64 {
        assert!(row < self.rows, "row {row} of {}", self.rows);
        let (first, line) = self.runs[self.runs.partition_point(|run| run.0 <= row) - 1];
        line + (row - first) as u64
    }

    /// The lines of all rows.
    pub fn iter(&self) -> impl Iterator<Item = u64> + '_ {
        let ends = self.runs.iter().skip(1).map(|run| run.0).chain([self.rows]);
        self.runs.iter().zip(ends).flat_map(|(&(from, line), to)| line..line + (to - from) as u64)
    }

    pub(crate) fn push(&mut self, line: u64) {
        let follows = self.runs.last().is_some_and(|(row, first)| first + (self.rows - row) as u64 == line);
        if !follows {
            self.runs.push((self.rows, line));
        }
        self.rows += 1;
    }

    /// Appends the rows of another part of the file, which begins after `before` lines.
    pub(super) fn append(&mut self, part: &Self, before: u64) {
        let ends = part.runs.iter().skip(1).map(|run| run.0).chain([part.rows]);
        for (&(from, line), to) in part.runs.iter().zip(ends) {
            self.push(before + line);
            self.rows += to - from - 1;
        }
    }

    /// The lines of some rows.
    pub(super) fn of(&self, rows: &[bool]) -> Self {
        self.iter().zip(rows).filter(|(_, used)| **used).map(|(line, _)| line).collect()
    }
}

impl FromIterator<u64> for Lines {
    fn from_iter<I: IntoIterator<Item = u64>>(lines: I) -> Self {
        let mut all = Self::default();
        lines.into_iter().for_each(|line| all.push(line));
        all
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn runs_of_lines_are_the_lines(
            steps in prop::collection::vec(prop_oneof![4 => Just(1_u64), 1 => 0..5_u64], 1..40),
            cut in 0..40_usize,
        ) {
            let all: Vec<u64> = steps.iter().scan(1, |line, step| { *line += step; Some(*line) }).collect();
            let lines: Lines = all.iter().copied().collect();
            prop_assert_eq!((0..lines.len()).map(|row| lines.get(row)).collect::<Vec<_>>(), all.clone());
            prop_assert_eq!(lines.iter().collect::<Vec<_>>(), all.clone());
            let cut = cut.min(all.len());
            let mut joined: Lines = all[..cut].iter().copied().collect();
            joined.append(&all[cut..].iter().map(|line| line - 1).collect(), 1);
            prop_assert_eq!(&joined, &lines);
            let used: Vec<bool> = (0..all.len()).map(|row| (cut / 2..cut).contains(&row)).collect();
            prop_assert_eq!(lines.of(&used).iter().collect::<Vec<_>>(), all[cut / 2..cut].to_vec());
        }
    }
}
