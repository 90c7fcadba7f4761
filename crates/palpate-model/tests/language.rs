//! The model language: what is accepted, how errors read, and exact texts.

use std::path::Path;

use insta::assert_snapshot;
use palpate_model::language::{
    AppearanceEntries, AttachmentEntries, Block, Branch, ContactEntries, Fixed, FixedRegion,
    MaterialEntries, PathKey, RegionEntries, Rotation, Settings, Span, Transform, Tree, Unit,
};
use palpate_model::{Document, Law};
use proptest::prelude::*;

fn parse(text: &str) -> Document {
    Document::parse(text, Path::new("case.bml")).unwrap_or_else(|error| panic!("{error}"))
}

fn errors(text: &str) -> String {
    let error = Document::parse(text, Path::new("case.bml")).expect_err(text);
    assert!(!error.diagnostics.is_empty());
    error.to_string()
}

/// The errors in one line each.
fn brief(text: &str) -> String {
    let error = Document::parse(text, Path::new("case.bml")).expect_err(text);
    let lines = error.diagnostics.iter().map(|diagnostic| {
        let hint = diagnostic.hint.as_ref().map(|hint| format!(" ({hint})")).unwrap_or_default();
        format!("{}:{}: {}{hint}", diagnostic.line, diagnostic.column, diagnostic.message)
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The paper's only sample, in our canonical form.
const SAMPLE: &str = "\
BRANCH{
  ME{ trans 0,0,0  rot 1,0,0,0  scale 1,1,1 }
  TREE{
    ME{ trans 2,0,0  rot 1,0,0,0  scale 1,1,2 }
    PE 1
    NE kidney.seg
  }
  TREE{
    ME{ trans 0,-2.5,-1.4  rot 1,0,0,0  scale 1,1,2 }
    PE 2
    NE aorta.seg
  }
}
";

#[test]
fn the_canonical_sample_is_its_own_canonical_text() {
    assert_eq!(parse(SAMPLE).to_text(), SAMPLE);
}

#[test]
fn other_spellings_say_the_same() {
    let sample = parse(SAMPLE);
    let parentheses = SAMPLE.replace('{', "(").replace('}', ")");
    assert_eq!(parse(&parentheses), sample);
    let bare = SAMPLE.replace("ME{", "ME").replace("1,1,1 }", "1,1,1").replace("1,1,2 }", "1,1,2");
    assert_eq!(parse(&bare), sample);
    assert_eq!(parse(&SAMPLE.replace(',', "  ").replace('\n', " ")), sample);
    assert_eq!(parse(&SAMPLE.replace('\n', " // comment { ( PE\r\n")), sample);
    let other_order = "BRANCH { TREE { NE kidney.seg PE 1 ME { scale 1 1 2 trans 2,0,0 } }
        TREE( NE \"aorta.seg\" ME( rot axis 1,2,3 angle 0 trans 0,-2.5,-1.4 scale 1,1,2 ) PE 2 )
        ME{ } }";
    let mut expected = sample;
    let Block::Branch(branch) = &mut expected.root else { unreachable!("the sample is a BRANCH") };
    let Block::Tree(tree) = &mut branch.children[1] else { unreachable!("with two TREEs") };
    let transform = tree.settings.transform.as_mut().expect("with an ME");
    transform.rotation = Rotation::AxisAngle { axis: [1.0, 2.0, 3.0], degrees: 0.0 };
    assert_eq!(parse(other_order), expected);
}

#[test]
fn the_printed_figure_gives_one_error_at_the_surplus_bracket() {
    let after_me = "BRANCH(
  ME trans 0,0,0 rot 1,0,0,0 scale 1,1,1 }
  TREE(
    ME trans 2,0,0 rot 1,0,0,0 scale 1,1,2
    PE 1
    NE kidney.seg
  }
  TREE(
    ME trans 0,-2.5,-1.4 rot 1,0,0,0 scale 1,1,2
    PE 2
    NE aorta.seg
  }
}";
    assert_snapshot!(errors(after_me), @r"
    error: this `}` closes nothing
     --> case.bml:2:42
      |
    2 |   ME trans 0,0,0 rot 1,0,0,0 scale 1,1,1 }
      |                                          ^
      |
      = help: the block around it is not finished: remove it, or open a bracket for it after ME
    ");
    let in_tree = after_me.replace("1,1,1 }", "1,1,1").replacen("1,1,2", "1,1,2 }", 1);
    assert_snapshot!(brief(&in_tree), @"4:44: this `}` closes nothing (the block around it is not finished: remove it, or open a bracket for it after ME)");
    let at_the_end = after_me.replace("1,1,1 }", "1,1,1") + "\n}";
    assert_snapshot!(brief(&at_the_end), @"14:1: this `}` closes nothing (every block before it is closed already: remove it)");
    let without = after_me.replace("1,1,1 }", "1,1,1");
    assert_snapshot!(brief(&without), @"7:3: expected `)` to close the `(` of this block, found `}`");
}

#[test]
fn every_extension_is_read() {
    let text = "\
unit mm
gravity 0,-9.81,0
BRANCH{
  MT{ law linear  young 5000  poisson 0.45  density 1000  damping 0.01  mass_damping 0 }
  CN{ friction 0.3  distance 0.001  stiffness 1000000  self off }
  VE{ color 0.8,0.3,0.2  opacity 0.5 }
  TREE kidney_left{
    NE \"file with spaces.vtk\"
    FX{ box 0,0,0 1,1,1 }
    FX{ sphere 1,2,3 0.5 }
    FX{ set hilum }
    IV 0,0,-1.5
    MT{ young 8000 }
  }
  TREE \"the table\"{
    ME{ trans 0,0,-1  rot axis 0,0,1 angle 90  scale 1,1,1 }
    NE table.seg
    RG fixed
  }
  TREE{
    NE tool.seg
    RG{
      at 0  trans 0,0,0  rot 1,0,0,0
      at 1.5  trans 0,0,0.05  rot axis 0,0,1 angle 90
    }
  }
}
";
    let document = parse(text);
    assert_eq!(document.to_text(), text);
    let spread = text.replace("RG fixed", "RG { fixed }").replace(
        "FX{ box 0,0,0 1,1,1 }\n    FX{ sphere 1,2,3 0.5 }",
        "FX box 0 0 0, 1 1 1 sphere 1 2 3 0.5",
    );
    assert_eq!(parse(&spread), document);
    assert_eq!(document.unit, Unit::Millimetre);
}

#[test]
fn errors_read_like_a_compilers() {
    assert_snapshot!(errors("BRANCH{\n  TREE{\n    ME{ trasn 2,0,0 }\n    PEE 1\n    NE kidney.seg\n  }\n}\n"), @r"
    error: unknown word `trasn`
     --> case.bml:3:9
      |
    3 |     ME{ trasn 2,0,0 }
      |         ^^^^^
      |
      = help: trasn: did you mean trans?

    error: unknown word `PEE`
     --> case.bml:4:5
      |
    4 |     PEE 1
      |     ^^^
      |
      = help: PEE: did you mean PE?
    ");
    assert_snapshot!(errors("TREE{ ME{ rot 0.5,0,0,1 } NE a.seg }"), @r"
    error: rot w,x,y,z is a quaternion of length 1, found length 1.1180
     --> case.bml:1:11
      |
    1 | TREE{ ME{ rot 0.5,0,0,1 } NE a.seg }
      |           ^^^
      |
      = help: the real part comes first; to give axis and angle, write `rot axis x,y,z angle DEG`
    ");
    assert_snapshot!(errors("// nothing\n"), @r"
    error: expected BRANCH or TREE, found the end of the file
     --> case.bml:2:1
      |
    2 |
      | ^
      |
      = help: a model is one block: TREE{ NE kidney.seg }, or a BRANCH of several TREEs
    ");
    let colored = Document::parse("", Path::new("a.bml")).unwrap_err().colored();
    assert!(colored.contains('\u{1b}'));
}

#[test]
fn materials_of_regions_are_read_beside_that_of_the_body() {
    let text = "\
TREE{
  NE aorta.seg
  MT{ law hgo  young 9000  k1 2363.2  k2 0.84  kappa 0.1  fibre 0,0,1  fibre_2 0,1,1 }
  MT region -2 { law mooney-rivlin  mooney 0.25 }
  MT region 7 {  }
}
";
    let document = parse(text);
    assert_eq!(document.to_text(), text);
    let Block::Tree(tree) = &document.root else { panic!("a TREE") };
    let [first, second] = &tree.settings.regions[..] else { panic!("two regions") };
    assert_eq!((first.region, first.entries.law), (-2, Some(Law::MooneyRivlin)));
    assert_eq!(second.entries, MaterialEntries::default());
    assert_eq!(
        parse("TREE{ NE a.seg MT region 3 young 1 }").to_text(),
        "\
TREE{
  NE a.seg
  MT region 3 { young 1 }
}
"
    );
    let text = "\
TREE{ NE a.seg MT region 1.5 { young 1 } MT region 2 { damping 1 } MT region 2 { kappa 0.4 }
  MT{ fibre 0,0,0 mooney 2 k2 0 law hgoo } MT{ young 1 } MT region { young 1 } }
";
    assert_snapshot!(brief(text), @r"
    1:26: region takes a whole number, found 1.5
    1:56: damping is that of the whole body, not of a region (write MT{ damping ... })
    1:68: a second MT of this region in this block; it may stand once
    1:88: kappa must be from 0 to 1/3, found 0.4
    2:13: the fibre 0,0,0 has no direction
    2:26: mooney must be from 0 to 1, found 2
    2:31: k2 must be greater than 0, found 0
    2:37: law is one of linear, corotated, stvk, neo-hookean, mooney-rivlin, hgo, found `hgoo` (hgoo: did you mean hgo?)
    2:44: a second MT in this block; it may stand once
    2:61: region takes one number, found `{`
    ");
}

#[test]
fn several_errors_come_in_one_run_and_none_twice() {
    let text = "\
unit furlong
gravity 0,0
BRANCH{
  ME{ trans 1,2 rot 1,0,0,0 rot 1,0,0,0 scale 0,1,1 }
  TREE{ PE -1 NE a.seg PE 2 }
  TREE{ NE }
  TREE{ PE 1.5 }
  Tree{ NE b.seg MT{ poisson 0.5 young -3 density zero law linaer } }
  TREE{ NE my file.vtk VE{ opacity 2 color 1,2,0 } CN{ self yes friction -1 } }
  TREE{ NE c.seg FX{ sphere 0,0,0 -1 } FX{} FX{ set } RG{ } IV 1,2,3,4 }
  TREE{ NE d.seg RG{ at 1 trans 0,0,0 at 1 } }
  TREE{ NE e.seg RG{ fixed at 1 } trans 1,2,3 }
  TREE{ NE f.seg RG{ trans 1,2,3 } ME }
  TREE x{ NE g.seg }
  TREE x{ NE g.seg WHAT 1,2 { 3 } PE 0 }
  BRANCH{ PE 3 }
  BRANCH{ }
  TREE{ NE h.seg ME{ rot axis 0,0,0 angle 3 scale 1e999,1,1 trans 1mm,2,3 } }
  ME{ }
}
";
    assert_snapshot!(brief(text), @r#"
    1:6: expected a unit (m, dm, cm, mm, um), found `furlong`
    2:1: gravity takes 3 numbers, found 2
    4:7: trans takes 3 numbers, found 2
    4:29: a second rot in this ME; it may stand once
    4:41: a scale of 0 flattens the body (write 1 for an axis that keeps its size)
    5:12: PE takes a whole number from 0 on, found -1
    5:24: a second PE in this block; it may stand once
    6:9: NE is followed by a file name, found `}` (quote a name with unusual characters: NE "a b.vtk")
    7:12: PE takes a whole number from 0 on, found 1.5
    8:3: unknown word `Tree` (Tree: did you mean TREE?)
    8:30: poisson must be greater than -1 and less than 0.5, found 0.5
    8:40: young must be greater than 0, found -3
    8:43: density takes one number, found `zero`
    8:60: law is one of linear, corotated, stvk, neo-hookean, mooney-rivlin, hgo, found `linaer` (linaer: did you mean linear?)
    9:12: two words after NE (quote a name with blanks: NE "my file.vtk")
    9:36: opacity must be from 0 to 1, found 2
    9:38: color takes red, green, blue from 0 to 1
    9:61: self is on or off, found `yes`
    9:74: friction must be 0 or more, found -1
    10:22: the radius of a sphere must be greater than 0, found -1
    10:40: this FX holds nothing (write FX{ box x,y,z x,y,z }, FX{ sphere x,y,z radius } or FX{ set name })
    10:49: set takes the name of a node set, found `}`
    10:55: this RG says nothing (write RG fixed, or a path: RG{ at 0 trans 0,0,0  at 1.5 trans 0,0,0.05 })
    10:61: IV takes 3 numbers, found 4
    11:39: times of a path must increase: 1 comes after 1
    12:28: a rigid body is fixed or follows a path, not both
    12:35: `trans` belongs into ME (write ME{ trans ... })
    13:22: trans of a path stands after its time (write RG{ at 0 trans 0,0,0  at 1.5 trans 0,0,0.05 })
    13:36: ME is followed by `{` or by one of trans, rot, scale, found `}`
    15:8: a second TREE named `x`; names are unique
    15:20: unknown word `WHAT` (expected one of ME, PE, NE, MT, FX, RG, CN, VE, IV)
    16:11: PE does not stand in a BRANCH
    17:3: this BRANCH is empty (a BRANCH groups one or more TREEs or BRANCHes)
    18:26: the axis 0,0,0 has no direction
    18:51: `1e999` is larger than any number here may be
    18:67: `1mm` is not a number
    19:3: a second ME in this block; it may stand once
    "#);
}

#[test]
fn brackets_out_of_balance_give_one_error_each() {
    let cases = [
        "TREE{ NE a.seg",
        "BRANCH{ TREE{ NE a.seg TREE{ NE b.seg } }",
        "BRANCH{ TREE{ ME{ trans 1,2,3 NE a.seg } TREE{ NE b.seg } }",
        "BRANCH{ TREE{ NE a.seg } } }",
        "BRANCH{ TREE{ NE a.seg ) }",
        "BRANCH TREE{ NE a.seg } }",
        "BRANCH{ TREE{ NE a.seg } TREE NE b.seg } }",
        "TREE{ NE a.seg } TREE{ NE b.seg }",
        "BRANCH{ TREE{ NE a.seg BRANCH{ TREE{ NE c.seg } } } }",
        "TREE{ NE a.seg } unit mm",
        "TREE{ NE \"a.seg }",
        "PE 1 TREE{ NE a.seg }",
        "TREE{ NE a.seg } what",
        "{ }",
    ];
    let text: Vec<String> = cases
        .iter()
        .map(|text| format!("{text}\n  {}", brief(text).replace('\n', "\n  ")))
        .collect();
    assert_snapshot!(text.join("\n"), @r#"
    TREE{ NE a.seg
      1:5: this bracket is never closed
    BRANCH{ TREE{ NE a.seg TREE{ NE b.seg } }
      1:13: this TREE is not closed before the next TREE
    BRANCH{ TREE{ ME{ trans 1,2,3 NE a.seg } TREE{ NE b.seg } }
      1:17: this bracket is never closed
    BRANCH{ TREE{ NE a.seg } } }
      1:28: this `}` closes nothing (every block before it is closed already: remove it)
    BRANCH{ TREE{ NE a.seg ) }
      1:24: expected `}` to close the `{` of this block, found `)`
    BRANCH TREE{ NE a.seg } }
      1:8: expected `{` after BRANCH, found `TREE`
    BRANCH{ TREE{ NE a.seg } TREE NE b.seg } }
      1:31: expected `{` after TREE, found `NE`
    TREE{ NE a.seg } TREE{ NE b.seg }
      1:18: a second block `TREE` at the top of the model (join both in one BRANCH{ ... })
    BRANCH{ TREE{ NE a.seg BRANCH{ TREE{ NE c.seg } } } }
      1:24: `BRANCH` stands in a TREE, which holds one organ (close the TREE before it, and join both in a BRANCH)
    TREE{ NE a.seg } unit mm
      1:18: `unit` stands before the first block (move it to the top of the file)
    TREE{ NE "a.seg }
      1:10: this text has no closing quote (a quoted text ends on its line; write "" for a quote in it)
    PE 1 TREE{ NE a.seg }
      1:1: PE stands in a TREE, not at the top of the model
    TREE{ NE a.seg } what
      1:18: expected the end of the file, found `what`
    { }
      1:1: expected one of BRANCH, TREE, found `{`
    "#);
}

#[test]
fn places_count_characters_and_lines() {
    let error = Document::parse("TREE{\r\n  /* \u{e9}\u{e9} */ NE a.seg }", Path::new("a.bml"))
        .unwrap_err();
    assert_eq!((error.first().line, error.first().column), (2, 3));
    let error = Document::parse("TREE \"\u{e9}\u{e9}\"{ XX }", Path::new("a.bml")).unwrap_err();
    assert_eq!((error.first().line, error.first().column), (1, 12));
    assert_eq!(error.first().path, Path::new("a.bml"));
}

#[test]
fn depth_and_number_of_blocks_are_bounded() {
    let deep = "BRANCH{".repeat(100_000);
    assert!(brief(&deep).contains("nested more than 64 deep"));
    let sound = "BRANCH{".repeat(64) + "TREE{ NE a.seg }" + &"}".repeat(64);
    parse(&sound);
    let many = format!("BRANCH{{{}}}", "TREE{ NE a.seg }".repeat(10_001));
    assert!(brief(&many).contains("more than 10000 bodies"));
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        -10.0..10.0,
        prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
        (-5..6_i32).prop_map(f64::from),
    ]
}

fn positive() -> impl Strategy<Value = f64> {
    number().prop_map(f64::abs).prop_filter("zero", |value| *value > 0.0)
}

fn triple() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(number())
}

fn name() -> impl Strategy<Value = String> {
    prop_oneof!["[a-z_./]{1,12}", "[^\\n]{1,12}", Just("TREE".to_owned()), Just("a//b".to_owned())]
}

fn rotation() -> impl Strategy<Value = Rotation> {
    let quaternion = prop::array::uniform4(-1.0..1.0)
        .prop_filter("zero", |q: &[f64; 4]| q.iter().map(|x| x * x).sum::<f64>() > 1e-6)
        .prop_map(|q| {
            let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            Rotation::Quaternion(q.map(|x| x / length))
        });
    let axis = triple().prop_filter("zero", |axis| *axis != [0.0; 3]);
    prop_oneof![
        quaternion,
        (axis, number()).prop_map(|(axis, degrees)| Rotation::AxisAngle { axis, degrees })
    ]
}

fn material_entries() -> impl Strategy<Value = MaterialEntries> {
    let some = || prop::option::of(positive());
    let law = prop::sample::select(Law::NAMES.to_vec()).prop_map(|name| name.parse().unwrap());
    let fibre = || prop::option::of(triple().prop_filter("zero", |fibre| *fibre != [0.0; 3]));
    let common = (prop::option::of(law), some(), prop::option::of(-0.99..0.49), some());
    let special = (
        prop::option::of(0.0..=1.0),
        some(),
        some(),
        prop::option::of(0.0..=1.0 / 3.0),
        [fibre(), fibre()],
    );
    (common, special).prop_map(
        |((law, young, poisson, density), (mooney, k1, k2, kappa, fibres))| MaterialEntries {
            law,
            young,
            poisson,
            density,
            mooney,
            k1,
            k2,
            kappa,
            fibres,
            ..MaterialEntries::default()
        },
    )
}

fn settings() -> impl Strategy<Value = Settings> {
    let scale = prop::array::uniform3(number().prop_filter("zero", |value| *value != 0.0));
    let transform = (triple(), rotation(), scale)
        .prop_map(|(translation, rotation, scale)| Transform { translation, rotation, scale });
    let some = || prop::option::of(positive());
    let material =
        (material_entries(), some(), some()).prop_map(|(entries, damping, mass_damping)| {
            MaterialEntries { damping, mass_damping, ..entries }
        });
    let regions =
        prop::collection::btree_map(any::<i16>(), material_entries(), 0..3).prop_map(|regions| {
            let blocks = regions.into_iter().map(|(region, entries)| RegionEntries {
                region: region.into(),
                entries,
                span: Span::default(),
            });
            blocks.collect::<Vec<_>>()
        });
    let contact = (some(), some(), some(), any::<Option<bool>>()).prop_map(
        |(friction, distance, stiffness, self_contact)| ContactEntries {
            friction,
            distance,
            stiffness,
            self_contact,
        },
    );
    let fraction = || 0.0..=1.0;
    let appearance =
        (prop::option::of(prop::array::uniform3(fraction())), prop::option::of(fraction()))
            .prop_map(|(color, opacity)| AppearanceEntries { color, opacity });
    (prop::option::of(transform), material, regions, contact, appearance).prop_map(
        |(transform, material, regions, contact, appearance)| Settings {
            transform,
            material,
            regions,
            contact,
            appearance,
        },
    )
}

fn tree() -> impl Strategy<Value = Block> {
    let region = prop_oneof![
        (triple(), triple()).prop_map(|(a, b)| FixedRegion::Box(a, b)),
        (triple(), positive()).prop_map(|(center, radius)| FixedRegion::Sphere { center, radius }),
        name().prop_map(FixedRegion::Set),
    ];
    let fixed = region.prop_map(|region| Fixed { region, span: Span::default() });
    let key = (number(), triple(), rotation()).prop_map(|(time, translation, rotation)| PathKey {
        time,
        translation,
        rotation,
    });
    let rigid = prop::collection::vec(key, 0..4).prop_map(|mut keys| {
        keys.sort_by(|a, b| a.time.total_cmp(&b.time));
        keys.dedup_by(|a, b| a.time == b.time);
        keys
    });
    (
        settings(),
        any::<Option<u32>>(),
        name(),
        prop::collection::vec(fixed, 0..3),
        prop::option::of(rigid),
        prop::option::of(triple()),
    )
        .prop_map(|(settings, processor, file, fixed, rigid, initial_velocity)| {
            Block::Tree(Box::new(Tree {
                settings,
                processor,
                file,
                fixed,
                rigid,
                initial_velocity,
                ..Tree::default()
            }))
        })
}

fn document() -> impl Strategy<Value = Document> {
    let block = tree().prop_recursive(4, 12, 3, |inner| {
        let attachment =
            ([name(), name()], prop::option::of(positive()), prop::option::of(positive()))
                .prop_map(|(bodies, within, stiffness)| AttachmentEntries {
                    bodies,
                    within,
                    stiffness,
                    span: Span::default(),
                });
        (settings(), prop::collection::vec(inner, 1..4), prop::collection::vec(attachment, 0..3))
            .prop_map(|(settings, children, attachments)| {
                Block::Branch(Box::new(Branch { settings, children, attachments }))
            })
    });
    let unit = prop::sample::select(vec!["m", "dm", "cm", "mm", "um"]);
    (block, unit, triple(), prop::option::of(name())).prop_map(|(root, unit, gravity, name)| {
        let mut document = Document::new(root);
        document.unit = Unit::from_name(unit).unwrap();
        document.gravity = gravity;
        if let Block::Tree(tree) = &mut document.root {
            tree.name = name;
        }
        document
    })
}

/// Words of the language, brackets, numbers and near misses, in any order.
fn soup() -> impl Strategy<Value = String> {
    let word = prop::sample::select(vec![
        "BRANCH",
        "TREE",
        "ME",
        "PE",
        "NE",
        "MT",
        "FX",
        "RG",
        "CN",
        "VE",
        "IV",
        "AT",
        "join",
        "within",
        "{",
        "}",
        "(",
        ")",
        "{",
        "}",
        "trans",
        "rot",
        "scale",
        "axis",
        "angle",
        "1,0,0,0",
        "1,2,3",
        "1",
        "-2.5",
        "a.seg",
        "\"x\"",
        "\"",
        "//",
        "\n",
        "unit",
        "mm",
        "gravity",
        "law",
        "linear",
        "young",
        "poisson",
        "region",
        "neo-hookean",
        "fibre",
        "kappa",
        "self",
        "on",
        "friction",
        "box",
        "sphere",
        "set",
        "fixed",
        "at",
        "color",
        "opacity",
        "PEE",
        "trasn",
        "Tree",
        "1mm",
        "1e999",
        "nan",
        "\u{e9}\u{1f600}",
        "\t",
        "BRANCH{",
        "TREE{",
    ]);
    prop::collection::vec(word, 0..60).prop_map(|words| words.join(" "))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn text_of_a_document_reads_back_to_it(document in document()) {
        let text = document.to_text();
        let back = Document::parse(&text, Path::new("case.bml"));
        prop_assert!(back.is_ok(), "{text}\n{}", back.unwrap_err());
        let back = back.unwrap();
        prop_assert_eq!(&back, &document);
        prop_assert_eq!(back.to_text(), text);
    }

    #[test]
    fn arbitrary_text_never_panics(text in any::<String>()) {
        if let Err(error) = Document::parse(&text, Path::new("case.bml")) {
            prop_assert!(!error.diagnostics.is_empty() && !error.to_string().is_empty());
        }
    }

    #[test]
    fn token_soup_never_panics_and_what_is_accepted_is_exact(text in soup()) {
        match Document::parse(&text, Path::new("case.bml")) {
            Err(error) => {
                prop_assert!(!error.diagnostics.is_empty() && !error.to_string().is_empty());
                for diagnostic in &error.diagnostics {
                    prop_assert!(diagnostic.line >= 1 && diagnostic.column >= 1);
                }
            }
            Ok(document) => {
                prop_assert_eq!(parse(&document.to_text()), document);
            }
        }
    }
}

#[test]
fn attachments_are_read_and_written() {
    let text = "\
BRANCH{
  TREE kidney{
    NE kidney.seg
  }
  TREE \"the aorta\"{
    NE aorta.seg
  }
  AT{ join kidney \"the aorta\"  within 2  stiffness 100000 }
  AT{ join kidney \"within\" }
}
";
    assert_eq!(parse(text).to_text(), text);
    let bare = text.replace("AT{ join kidney \"within\" }", "AT join kidney \"within\"");
    assert_eq!(parse(&bare), parse(text));
    let wrong = "BRANCH{ TREE a{ NE a.seg AT{ join a b } }
AT{ within 2 } AT{ join a } AT{ join a within 3 } AT{ join a b within 0 } AT{ joyn a b }
AT{ join a b stiffness -1 } join a b }";
    assert_snapshot!(brief(wrong), @r"
    1:26: AT does not stand in a TREE
    2:1: this AT joins nothing (write join and the names of two bodies: AT{ join kidney aorta })
    2:20: join takes the names of two bodies, found `}`
    2:33: join takes the names of two bodies, found `within`
    2:71: within must be greater than 0, found 0
    2:79: unknown word `joyn` (joyn: did you mean join?)
    3:24: stiffness must be greater than 0, found -1
    3:29: `join` belongs into AT (write AT{ join ... })
    ");
}
