//! Readers against arbitrary and mutated bytes: an error or a mesh, never a panic, never much memory.

use proptest::prelude::*;

use super::{FORMATS, ReadOptions, build};

const SEG: &str = "// a corner\nseg 1\nnodes 5\n 0 0 0, 1 0 0\n 0 1 0\n 0 0 1 1 1 1\ntetrahedra 2\n \
    0 1 2 3\n 1 2 3 4\nregions 1 2\nset base 3 0 1 2\n";

const ASCII: &str = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 \
    float\n0 0 0 1 0 0 0 1 0\n0 0 1 1 1 1\nCELLS 3 14\n4 0 1 2 3\n4 1 2 3 4\n3 0 1 2\nCELL_TYPES 3\n10 10 5\n\
    POINT_DATA 5\nVECTORS v float\n1 2 3 4 5 6 7 8 9 10 11 12 13 14 15\nCELL_DATA 3\nSCALARS region int 1\n\
    LOOKUP_TABLE default\n7 8 9\nFIELD data 1\nx 2 3 double\n1 2 3 4 5 6\n";

const V5: &str = "# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 \
    double\n0 0 0 1 0 0 0 1 0 0 0 1\nMETADATA\nINFORMATION 0\n\nCELLS 2 4\nOFFSETS vtktypeint64\n0 4\n\
    CONNECTIVITY vtktypeint64\n0 1 2 3\nCELL_TYPES 1\n10\n";

fn binary() -> Vec<u8> {
    let mut bytes =
        b"# vtk DataFile Version 4.2\ntitle\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 \
        float\n"
            .to_vec();
    let corners = [0.0_f32, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.];
    bytes.extend(corners.iter().flat_map(|x| x.to_be_bytes()));
    bytes.extend(b"\nCELLS 1 5\n");
    bytes.extend([4, 0, 1, 2, 3_i32].iter().flat_map(|x| x.to_be_bytes()));
    bytes.extend(
        b"\nCELL_TYPES 1\n\0\0\0\x0a\nCELL_DATA 1\nFIELD f 1\nmaterial 1 1 int\n\0\0\0\x05\n",
    );
    bytes
}

fn try_all(bytes: &[u8]) -> usize {
    let mut built = 0;
    for format in FORMATS {
        let mut stream = bytes;
        let Ok(parsed) = (format.read)(&mut stream, bytes.len() as u64, None) else { continue };
        // A count that lies must not reserve more than the bytes could hold.
        assert!(parsed.data.nodes.capacity() <= bytes.len() + 1);
        assert!(parsed.data.tetrahedra.capacity() <= bytes.len() + 4);
        built += usize::from(build(parsed, ReadOptions { repair: true }).is_ok());
    }
    built
}

#[test]
fn the_seeds_are_meshes() {
    for seed in [SEG.as_bytes(), ASCII.as_bytes(), V5.as_bytes(), &binary()] {
        assert_eq!(try_all(seed), 1, "{}", String::from_utf8_lossy(seed));
    }
}

#[test]
fn lying_counts_end_in_errors_at_once() {
    for text in [
        "seg 1 nodes 18446744073709551615 0 0 0",
        "seg 1 nodes 4000000000 0 0 0",
        "seg 1 tetrahedra 4000000000 1 2 3",
        "seg 1 set a 4000000000 1 2 3",
        "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 9999999999999 float 1",
        "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nCELLS 9999999999 99999999999 1 2",
        "# vtk DataFile Version 5.1\n\nBINARY\nDATASET UNSTRUCTURED_GRID\nCELLS 9999999999 99999999999\nOFFSETS int\n",
        "# vtk DataFile Version 3.0\n\nBINARY\nDATASET UNSTRUCTURED_GRID\nFIELD f 99\na 9999999999 9999999999 double\n",
        "# vtk DataFile Version 3.0\n\nBINARY\nDATASET UNSTRUCTURED_GRID\nFIELD f 9\na 1 99999 string\n\0\0",
    ] {
        assert_eq!(try_all(text.as_bytes()), 0, "{text}");
    }
}

fn mutated() -> impl Strategy<Value = Vec<u8>> {
    let seeds = vec![SEG.into(), ASCII.into(), V5.into(), binary()];
    let edit = (any::<prop::sample::Index>(), any::<u8>(), 0..4_u8);
    (prop::sample::select(seeds), prop::collection::vec(edit, 1..6)).prop_map(
        |(mut bytes, edits)| {
            for (at, byte, kind) in edits {
                let at = at.index(bytes.len());
                match kind {
                    0 => bytes[at] = byte,
                    1 => bytes.insert(at, b'0' + byte % 10),
                    2 if bytes.len() > 1 => drop(bytes.remove(at)),
                    _ => bytes.truncate(at.max(1)),
                }
            }
            bytes
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        try_all(&bytes);
    }

    #[test]
    fn mutated_files_never_panic(bytes in mutated()) {
        try_all(&bytes);
    }
}
