//! Filters of a query that reduce the data to read.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use datafusion::common::ScalarValue;
use datafusion::logical_expr::expr::InList;
use datafusion::logical_expr::{BinaryExpr, Expr, Operator};
use serde::{Deserialize, Serialize};

/// An upper bound on the rows that are read; `DataFusion` filters the remaining ones.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Asked {
    /// Log times of messages \[ns since the epoch\], both ends included.
    pub log_ns: RangeInclusive<i64>,
    /// Topics; `None` for all.
    pub topics: Option<BTreeSet<String>>,
    /// Names of recordings; `None` for all.
    pub recordings: Option<BTreeSet<String>>,
}

impl Default for Asked {
    /// No filter.
    fn default() -> Self {
        Self {
            log_ns: i64::MIN..=i64::MAX,
            topics: None,
            recordings: None,
        }
    }
}

impl Asked {
    /// Derives the bound from the conjunctive terms of a WHERE clause.
    pub fn of(filters: &[Expr]) -> Self {
        let mut asked = Self::default();
        for filter in filters {
            asked.add(filter);
        }
        asked
    }

    /// Whether a term of a WHERE clause reduces the data to read.
    pub fn takes(filter: &Expr) -> bool {
        Self::default().add(filter)
    }

    /// Whether the bound includes a recording of this name.
    pub fn wants(&self, recording: &str) -> bool {
        self.recordings
            .as_ref()
            .is_none_or(|names| names.contains(recording))
    }

    /// Adds a term; false if it does not reduce the data to read.
    fn add(&mut self, filter: &Expr) -> bool {
        match filter {
            Expr::BinaryExpr(BinaryExpr {
                left,
                op: Operator::And,
                right,
            }) => {
                let left = self.add(left);
                self.add(right) || left
            }
            Expr::BinaryExpr(BinaryExpr { left, op, right }) => match (&**left, &**right) {
                (Expr::Column(column), Expr::Literal(value, _)) => {
                    self.compare(&column.name, *op, value)
                }
                (Expr::Literal(value, _), Expr::Column(column)) => op
                    .swap()
                    .is_some_and(|op| self.compare(&column.name, op, value)),
                // A disjunction: DataFusion writes a short IN in this form.
                _ => *op == Operator::Or && self.either(filter),
            },
            Expr::Between(between) if !between.negated => {
                match (&*between.expr, &*between.low, &*between.high) {
                    (Expr::Column(column), Expr::Literal(low, _), Expr::Literal(high, _)) => {
                        let from = self.compare(&column.name, Operator::GtEq, low);
                        self.compare(&column.name, Operator::LtEq, high) || from
                    }
                    _ => false,
                }
            }
            Expr::InList(InList {
                expr,
                list,
                negated: false,
            }) => {
                let Expr::Column(column) = &**expr else {
                    return false;
                };
                let texts: Option<BTreeSet<String>> = list.iter().map(literal).collect();
                texts.is_some_and(|texts| self.names(&column.name, texts))
            }
            _ => false,
        }
    }

    /// `topic = 'a' OR topic = 'b'`.
    fn either(&mut self, filter: &Expr) -> bool {
        fn collect(expr: &Expr, found: &mut BTreeSet<String>, column: &mut Option<String>) -> bool {
            let Expr::BinaryExpr(BinaryExpr { left, op, right }) = expr else {
                return false;
            };
            match (&**left, op, &**right) {
                (_, Operator::Or, _) => {
                    collect(left, found, column) && collect(right, found, column)
                }
                (Expr::Column(of), Operator::Eq, right) => {
                    let same = column.get_or_insert_with(|| of.name.clone()) == &of.name;
                    same && literal(right).is_some_and(|text| {
                        found.insert(text);
                        true
                    })
                }
                _ => false,
            }
        }
        let (mut found, mut column) = (BTreeSet::new(), None);
        collect(filter, &mut found, &mut column)
            && column.is_some_and(|column| self.names(&column, found))
    }

    fn names(&mut self, column: &str, texts: BTreeSet<String>) -> bool {
        let slot = match column {
            "topic" => &mut self.topics,
            "recording" => &mut self.recordings,
            _ => return false,
        };
        *slot = Some(match slot.take() {
            Some(before) => before.intersection(&texts).cloned().collect(),
            None => texts,
        });
        true
    }

    fn compare(&mut self, column: &str, op: Operator, value: &ScalarValue) -> bool {
        match (column, value) {
            ("log_ns", ScalarValue::Int64(Some(ns))) => {
                let (start, end) = (*self.log_ns.start(), *self.log_ns.end());
                self.log_ns = match op {
                    Operator::Eq => start.max(*ns)..=end.min(*ns),
                    Operator::Gt => start.max(ns.saturating_add(1))..=end,
                    Operator::GtEq => start.max(*ns)..=end,
                    Operator::Lt => start..=end.min(ns.saturating_sub(1)),
                    Operator::LtEq => start..=end.min(*ns),
                    _ => return false,
                };
                true
            }
            (_, value) if op == Operator::Eq => {
                text(value).is_some_and(|text| self.names(column, BTreeSet::from([text])))
            }
            _ => false,
        }
    }
}

/// The text of a literal.
pub(crate) fn literal(expr: &Expr) -> Option<String> {
    match expr {
        Expr::Literal(value, _) => text(value),
        _ => None,
    }
}

fn text(value: &ScalarValue) -> Option<String> {
    match value {
        ScalarValue::Utf8(text) | ScalarValue::Utf8View(text) | ScalarValue::LargeUtf8(text) => {
            text.clone()
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use datafusion::prelude::{col, lit};

    use super::*;

    fn names(names: &[&str]) -> Option<BTreeSet<String>> {
        Some(names.iter().map(|&name| name.to_owned()).collect())
    }

    #[test]
    fn times_topics_and_recordings_save_reading_and_nothing_else_does() {
        let asked = Asked::of(&[
            col("log_ns")
                .gt_eq(lit(5_i64))
                .and(lit(9_i64).gt(col("log_ns"))),
            col("topic").in_list(vec![lit("/a"), lit("/b")], false),
            col("topic").eq(lit("/b")),
            col("recording")
                .eq(lit("x"))
                .or(col("recording").eq(lit("y"))),
            col("effort").gt(lit(1.0)),
        ]);
        assert_eq!(asked.log_ns, 5..=8);
        assert_eq!(asked.topics, names(&["/b"]));
        assert_eq!(asked.recordings, names(&["x", "y"]));
    }

    #[test]
    fn a_condition_that_need_not_hold_bounds_nothing() {
        let terms = [
            col("log_ns").gt(lit(5_i64)).or(col("effort").gt(lit(1.0))),
            col("topic").eq(lit("/a")).or(col("recording").eq(lit("x"))),
            col("topic").not_eq(lit("/a")),
            col("topic").in_list(vec![lit("/a")], true),
            col("log_ns").between(lit(1_i64), lit(2_i64)).is_false(),
        ];
        for term in terms {
            assert!(!Asked::takes(&term), "{term}");
            assert_eq!(Asked::of(&[term]), Asked::default());
        }
    }
}
