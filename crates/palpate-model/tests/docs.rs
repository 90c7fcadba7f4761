//! The examples in docs/ are what they say: models and meshes.

use std::fs;
use std::path::Path;

use palpate_model::{Document, MeshLoader, ReadOptions, load_model};
use tempfile::TempDir;

/// Contents of the fenced blocks of one language in a page of docs/.
fn examples(page: &str, language: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(page);
    let text = fs::read_to_string(&path).unwrap();
    let opening = format!("```{language}\n");
    let blocks = text.split(&opening).skip(1);
    blocks.map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

#[test]
fn every_model_in_the_language_page_is_one() {
    let models = examples("language.md", "bml");
    assert_eq!(models.len(), 5);
    for text in &models {
        let parsed = Document::parse(text, Path::new("language.md"));
        let document = parsed.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(Document::parse(&document.to_text(), Path::new("")).unwrap(), document);
    }
}

#[test]
fn the_error_in_the_language_page_is_what_is_shown() {
    let text = "BRANCH{\n  TREE{\n    NE kidney.seg\n\n    PEE 1\n  }\n}\n";
    let error = Document::parse(text, Path::new("case1.bml")).unwrap_err();
    assert_eq!(examples("language.md", "text")[0].trim_end(), error.to_string());
}

#[test]
fn every_mesh_in_the_formats_page_is_one() {
    let folder = TempDir::new().unwrap();
    let meshes = examples("formats.md", "seg");
    assert_eq!(meshes.len(), 2);
    for (number, text) in meshes.iter().enumerate() {
        fs::write(folder.path().join(format!("mesh_{number}.seg")), text).unwrap();
    }
    let mesh = |name| ReadOptions::default().load(&folder.path().join(name)).unwrap().mesh;
    assert_eq!(mesh("mesh_0.seg").tetrahedra().len(), 2);
    assert_eq!(mesh("mesh_0.seg").regions(), [1, 2]);
    assert_eq!(mesh("mesh_0.seg").node_sets()["base"], [0, 1, 2]);
    assert_eq!(mesh("mesh_1.seg").triangles(), [[0, 1, 2], [0, 2, 3]]);
    let model = folder.path().join("both.bml");
    fs::write(&model, "BRANCH{ TREE{ NE mesh_0.seg } TREE{ NE mesh_1.seg RG fixed } }").unwrap();
    assert_eq!(load_model(&model, &ReadOptions::default()).unwrap().bodies.len(), 2);
}
