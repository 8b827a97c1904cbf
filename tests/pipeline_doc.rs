//! The pipelines in `docs/pipeline.md`, `docs/publish.md` and `docs/fleet.md` are good ones.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use crate::common::{Out, bundled, root, write};

#[test]
fn every_pipeline_in_the_documentation_passes_the_check() {
    let pages = ["docs/pipeline.md", "docs/publish.md", "docs/fleet.md"];
    let text = pages.map(|page| std::fs::read_to_string(root().join(page)).unwrap());
    let text = text.concat();
    let blocks = text
        .split("```yaml\n")
        .skip(1)
        .map(|rest| rest.split("```").next().unwrap());
    let pipelines: Vec<&str> = blocks
        .filter(|block| block.starts_with("version: 1"))
        .collect();
    assert!(pipelines.len() >= 3, "{} pipelines", pipelines.len());
    for pipeline in pipelines {
        let folder = tempfile::tempdir().unwrap();
        for file in ["demo_arm.urdf", "demo.mcap"] {
            std::fs::copy(bundled().join(file), folder.path().join(file)).unwrap();
        }
        let file = write(&folder.path().join("pipeline.yaml"), pipeline);
        let out = Out::answer(["check", file.to_str().unwrap()]);
        assert_eq!(out.code, 0, "{pipeline}\n{}", out.stderr);
    }
}
