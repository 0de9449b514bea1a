//! Which findings make a command fail.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use super::{Finding, Rule, Severity};

/// A condition under which a command fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailOn {
    /// A finding of this severity or a higher one.
    Severity(Severity),
    /// A finding of this rule, whatever its severity.
    Rule(Rule),
}

impl FailOn {
    /// Whether a finding meets the condition.
    pub fn is_met_by(self, finding: &Finding) -> bool {
        match self {
            FailOn::Severity(least) => finding.severity >= least,
            FailOn::Rule(rule) => finding.rule == rule,
        }
    }

    /// Returns the ids of the rules of the findings that meet one of some conditions, each once, in order.
    pub fn rules_met(conditions: &[FailOn], findings: &[Finding]) -> Vec<&'static str> {
        let met = findings.iter().filter(|finding| conditions.iter().any(|condition| condition.is_met_by(finding)));
        let mut ids: Vec<&'static str> = met.map(|finding| finding.rule.id()).collect();
        ids.dedup();
        ids
    }
}

impl FromStr for FailOn {
    type Err = NoSuchRule;

    fn from_str(text: &str) -> Result<FailOn, NoSuchRule> {
        let severity = Severity::ALL.into_iter().find(|severity| severity.name() == text).map(FailOn::Severity);
        severity.or_else(|| Rule::by_id(text).map(FailOn::Rule)).ok_or(NoSuchRule)
    }
}

/// A text is neither a rule nor a severity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoSuchRule;

impl Display for NoSuchRule {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(
            f,
            "must be `note`, `warning`, `error` or a rule from `RK001` to `{}`",
            Rule::ALL[Rule::ALL.len() - 1].id()
        )
    }
}

impl std::error::Error for NoSuchRule {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Broken, Objects};

    #[test]
    fn findings_meet_their_rule_and_severities_up_to_theirs() {
        let finding = Finding::new(Objects::default(), &Broken::Outlier { area_ratio: 9.0 });
        let met = |text: &str| text.parse::<FailOn>().map(|condition| condition.is_met_by(&finding));
        let said = ["note", "warning", "error", "RK014", "rk014", "RK001"].map(met);
        assert_eq!(said, [true, true, false, true, true, false].map(Ok));
        assert_eq!(["info", "RK018", ""].map(met), [Err(NoSuchRule); 3]);
    }

    #[test]
    fn rules_are_named_once() {
        let finding = || Finding::new(Objects::default(), &Broken::Outlier { area_ratio: 9.0 });
        let conditions = [FailOn::Severity(Severity::Note), FailOn::Rule(Rule::Outlier)];
        assert_eq!(FailOn::rules_met(&conditions, &[finding(), finding()]), ["RK014"]);
        assert!(FailOn::rules_met(&[], &[finding()]).is_empty());
    }
}
