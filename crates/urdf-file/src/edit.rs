//! Changes in the text of a URDF file that leave everything else as it is.

use roxmltree::{Document, ParsingOptions};

use crate::Dynamics;

/// The text with other friction in some joints. None where the text is no XML.
#[must_use]
pub fn with_dynamics(text: &str, joints: &[(&str, Dynamics)]) -> Option<String> {
    let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).ok()?;
    let mut edits: Vec<(std::ops::Range<usize>, String)> = Vec::new();
    for joint in
        document.root_element().children().filter(|node| node.is_element() && node.tag_name().name() == "joint")
    {
        let Some((_, dynamics)) = joints.iter().find(|(name, _)| joint.attribute("name") == Some(name)) else {
            continue;
        };
        let element = format!("<dynamics damping=\"{}\" friction=\"{}\"/>", dynamics.damping, dynamics.friction);
        match joint.children().find(|node| node.tag_name().name() == "dynamics") {
            Some(old) => edits.push((old.range(), element)),
            None => {
                let end = text[joint.range()].rfind("</").map(|at| joint.range().start + at)?;
                edits.push((end..end, format!("  {element}\n  ")));
            }
        }
    }
    let mut changed = text.to_owned();
    edits.sort_by_key(|(range, _)| std::cmp::Reverse(range.start));
    for (range, element) in edits {
        changed.replace_range(range, &element);
    }
    Some(changed)
}

/// The text with more elements before the end of the robot. None where the text is no XML, or its robot is empty.
#[must_use]
pub fn with_elements(text: &str, elements: &str) -> Option<String> {
    let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).ok()?;
    let root = document.root_element().range();
    let end = root.start + text[root].rfind("</")?;
    Some(format!("{}{elements}{}", &text[..end], &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_changes_in_the_joints_that_are_named_and_nothing_else_does() {
        let text = "<robot name=\"r\"><!-- mine --><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>\
            <joint name=\"one\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><dynamics damping=\"1\"/></joint>\
            <joint name=\"two\" type=\"continuous\"><parent link=\"b\"/><child link=\"c\"/></joint></robot>";
        let friction = |damping, friction| Dynamics { damping, friction };
        let changed = with_dynamics(text, &[("one", friction(0.5, 2.0)), ("two", friction(0.25, 0.0))]).unwrap();
        let urdf = crate::parse(std::path::Path::new("r.urdf"), &changed).unwrap();
        let found: Vec<_> = urdf.joints.iter().map(|joint| (joint.dynamics.damping, joint.dynamics.friction)).collect();
        assert_eq!(found, [(0.5, 2.0), (0.25, 0.0)]);
        assert!(changed.contains("<!-- mine -->"));
        let commented = format!("{changed}<!-- </robot> -->");
        let more = with_elements(&commented, "<link name=\"d\"/>").unwrap();
        assert!(more.ends_with("<link name=\"d\"/></robot><!-- </robot> -->"), "{more}");
    }
}
