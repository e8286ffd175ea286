use super::*;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::fs;

fn parse(bytes: &[u8], path: &Path) -> Result<PolygonMesh, String> {
    super::parse(bytes, path, None)
}

/// Four corners of a unit square and indices of two triangles, padded to whole words.
fn payload() -> Vec<u8> {
    let mut bytes = Vec::new();
    for p in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]] {
        p.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    // Triangles as u8 at 48, strip as u16 at 56, fan as u32 at 64.
    bytes.extend([0u8, 1, 2, 0, 2, 3, 0, 0]);
    [0u16, 1, 3, 2].iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    [0u32, 1, 2, 3].iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    bytes
}

fn document(buffer: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,2]}}],
        "nodes":[{{"children":[1],"translation":[0,0,5],"rotation":[0,0,0.7071067811865476,0.7071067811865476],"scale":[2,2,2]}},
                 {{"mesh":0}},
                 {{"mesh":1,"matrix":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 10,0,0,1]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}},{{"attributes":{{"POSITION":0}},"indices":2,"mode":5}}]}},
                  {{"primitives":[{{"attributes":{{"POSITION":0}},"indices":3,"mode":6}},{{"attributes":{{"POSITION":0}},"mode":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
                     {{"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"}},
                     {{"bufferView":1,"byteOffset":8,"componentType":5123,"count":4,"type":"SCALAR"}},
                     {{"bufferView":1,"byteOffset":16,"componentType":5125,"count":4,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":32}}],
        "buffers":[{{{buffer}"byteLength":80}}]}}"#
    )
}

fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2u32.to_le_bytes());
    bytes.extend((12 + 8 + json.len() as u32 + 8 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(0x4E4F_534Au32, &json[..]), (0x004E_4942, binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(chunk);
    }
    bytes
}

#[test]
fn embedded_external_and_binary_buffers_give_the_same_placed_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shirt.gltf");
    fs::write(folder.path().join("its data.bin"), payload()).unwrap();
    let external = parse(document(r#""uri":"its%20data.bin","#).as_bytes(), &path).unwrap();
    let uri = format!(r#""uri":"data:application/octet-stream;base64,{}","#, STANDARD.encode(payload()));
    let embedded = parse(document(&uri).as_bytes(), &path).unwrap();
    let binary = parse(&glb(&document(""), &payload()), &path).unwrap();
    assert_eq!(external, embedded);
    assert_eq!(external, binary);

    // The first mesh: vertices once for its two primitives, turned by 90°, doubled, moved.
    assert_eq!(external.positions.len(), 8);
    for (p, q) in external.positions.iter().zip([[0., 0., 5.], [0., 2., 5.], [-2., 2., 5.], [-2., 0., 5.]]) {
        assert!((0..3).all(|a| (p[a] - q[a]).abs() < 1e-12), "{p:?}");
    }
    // The second one is mirrored: x → 10 − x, corners in the other order.
    assert_eq!(external.positions[4..6], [[10., 0., 0.], [9., 0., 0.]]);
    let triangles: Vec<&[u32]> = external.polygons().collect();
    let expected: [[u32; 3]; 6] = [[0, 1, 2], [0, 2, 3], [0, 1, 3], [3, 1, 2], [4, 6, 5], [4, 7, 6]];
    assert_eq!(triangles, expected);
}

#[test]
fn what_is_wrong_is_named() {
    let message = |json: String| parse(&glb(&json, &payload()), Path::new("a/x.glb")).unwrap_err();
    let whole = document("");
    for (from, to, part) in [
        (r#""count":4,"type":"VEC3""#, r#""count":5,"type":"VEC3""#, "accessor 0 has 5 items"),
        (r#""count":6"#, r#""count":18446744073709551615"#, "accessor 1 has 18446744073709551615 items"),
        (r#""count":6"#, r#""count":5"#, "5 indices do not make whole triangles"),
        (r#""byteOffset":16"#, r#""byteOffset":18446744073709551615"#, "accessor 3"),
        (r#""byteOffset":48,"byteLength":32"#, r#""byteOffset":48,"byteLength":99"#, "past the 80 bytes"),
        (r#""byteLength":80"#, r#""byteLength":81"#, "should have 81 bytes, but has 80"),
        (r#""count":6,"#, r#""count":6,"sparse":{"count":1},"#, "accessor 1 is sparse"),
        (r#""componentType":5126"#, r#""componentType":5123"#, "no VEC3 of floats"),
        (r#""scale":[2,2,2]"#, r#""scale":[2,2]"#, "glTF JSON"),
        (r#"{"mesh":0}"#, r#"{"mesh":7}"#, "mesh 7 of 2"),
        (r#"{"mesh":0}"#, r#"{"mesh":0,"children":[0]}"#, "reached twice"),
        (r#""mode":6"#, r#""mode":9"#, "mode 9"),
        (r#""asset""#, r#""extensionsRequired":["KHR_draco_mesh_compression"],"asset""#, "draco"),
        (r#""asset""#, r#""extensionsRequired":["FOO_shape"],"asset""#, "FOO_shape, which is not known"),
        (r#""asset""#, r#""extensionsUsed":["EXT_mesh_gpu_instancing"],"asset""#, "make them real"),
        (r#""scene":0"#, r#""scene":7"#, "scene 7 of 1"),
        (r#""version":"2.0""#, r#""version":"1.0""#, "glTF version 1.0"),
        (r#"{"byteLength":80}"#, r#"{"uri":"../secret.bin","byteLength":80}"#, "beside the document"),
        (r#"{"byteLength":80}"#, r#"{"uri":"none.bin","byteLength":80}"#, "none.bin"),
        (r#"{"byteLength":80}"#, r#"{"uri":"data:;base64,!!","byteLength":80}"#, "base64"),
    ] {
        assert!(whole.contains(from), "{from}");
        let message = message(whole.replacen(from, to, 1));
        assert!(message.contains(part), "{message}");
    }
    let bytes = glb(&whole, &payload());
    assert!(parse(&bytes[..bytes.len() - 1], Path::new("x")).unwrap_err().contains("truncated"));
    assert!(parse(b"{}", Path::new("x")).unwrap().positions.is_empty());
}

#[test]
fn an_index_past_its_own_vertices_reads_no_other_primitives_ones() {
    // Between the two primitives of vertices 0 there is one of vertices of its own; index 4 would be its first.
    let own = r#"{"attributes":{"POSITION":0},"indices":1}"#;
    let other = r#"{"attributes":{"POSITION":4},"indices":1}"#;
    let json = document("")
        .replacen(r#"{"attributes":{"POSITION":0},"indices":1},"#, &format!("{own},{other},"), 1)
        .replacen(
            r#""byteOffset":16,"componentType":5125,"count":4,"type":"SCALAR"}]"#,
            r#""byteOffset":16,"componentType":5125,"count":4,"type":"SCALAR"},{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}]"#,
            1,
        );
    let mut bytes = payload();
    assert_eq!(parse(&glb(&json, &bytes), Path::new("x.glb")).unwrap().positions.len(), 12);
    // The strip's second index.
    bytes[58] = 4;
    let message = parse(&glb(&json, &bytes), Path::new("x.glb")).unwrap_err();
    assert!(message.contains("primitive 2: names vertex 4, but has 4 vertices"), "{message}");
}

#[test]
fn of_several_meshes_the_one_that_is_named_is_read() {
    let json = document("").replacen(r#"{"mesh":0}"#, r#"{"mesh":0,"name":"Body"}"#, 1);
    let of = |only| super::parse(&glb(&json, &payload()), Path::new("x.glb"), only);
    assert_eq!(of(None).unwrap().positions.len(), 8);
    assert_eq!(of(Some("body")).unwrap().positions.len(), 4);
    let message = of(Some("coat")).unwrap_err();
    assert!(message.contains("of its 2 meshes 0 are named 'coat'"), "{message}");
}

#[test]
fn texture_coordinates_are_read_by_vertex_with_v_up() {
    let accessor = r#"{"bufferView":0,"componentType":5126,"count":4,"type":"VEC2"}"#;
    let textured = |accessor: &str| {
        let json = document("").replacen(r#"{"POSITION":0}"#, r#"{"POSITION":0,"TEXCOORD_0":4}"#, 1).replace(
            r#"],
        "bufferViews""#,
            &format!(
                r#",{accessor}],
        "bufferViews""#
            ),
        );
        parse(&glb(&json, &payload()), Path::new("x.glb")).unwrap()
    };
    let mesh = textured(accessor);
    assert_eq!(mesh.texture[..4], [[0.0, 1.0], [0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]);
    // The second mesh has none of its own.
    assert_eq!(mesh.texture[4..], [[0.0; 2]; 4]);
    // Normalised integers need no extension.
    let shares = r#"{"bufferView":1,"componentType":5121,"normalized":true,"count":4,"type":"VEC2"}"#;
    assert_eq!(textured(shares).texture[..2], [[0.0, 254.0 / 255.0], [2.0 / 255.0, 1.0]]);
    // What is no texture coordinate for every vertex is read over.
    for wrong in
        [accessor.replace('4', "3"), accessor.replace("VEC2", "VEC3"), accessor.replace("5126", "5121")]
    {
        assert!(textured(&wrong).texture.is_empty(), "{wrong}");
    }
}

/// One triangle at `accessor`, in a buffer that begins with its corners as floats, and what else is said of it.
fn triangle(
    accessor: &str,
    primitive: &str,
    node: &str,
    more: &str,
    binary: &[u8],
) -> Result<PolygonMesh, String> {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0{node}}},{{"scale":[0.01,0.01,0.01],"translation":[0,1,0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{primitive}],"weights":[0.5]}}],
        "accessors":[{{"count":3,"type":"VEC3",{accessor}}},
                     {{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":1,"componentType":5121,"count":3,"type":"VEC4"}},
                     {{"bufferView":2,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":36}},
                       {{"buffer":0,"byteOffset":72,"byteLength":12}},{{"buffer":0,"byteLength":36,"byteStride":8}}],
        "buffers":[{{"byteLength":84}}]{more}}}"#
    );
    parse(&glb(&json, binary), Path::new("x.glb"))
}

#[test]
fn what_changes_a_shape_is_applied() {
    let corners = [[0.0f32, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let floats =
        |numbers: &[[f32; 3]]| numbers.iter().flatten().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let plain = r#""bufferView":0,"componentType":5126"#;

    // A morph target of displacements, at the mesh's weight and at the node's.
    let morphed = [floats(&corners), floats(&[[0.0, 0.0, 2.0]; 3]), vec![0; 12]].concat();
    let target = r#"},"targets":[{"POSITION":1}]}"#;
    let at = |node: &str| triangle(plain, target, node, "", &morphed).unwrap().positions[1];
    assert_eq!(
        [at(""), at(r#","weights":[1]"#), at(r#","weights":[0]"#)],
        [[2., 0., 1.], [2., 0., 2.], [2., 0., 0.]]
    );

    // Integers, normalised ones from -1 to 1.
    let shorts: Vec<u8> = [[0i16, 0, 0, 0], [32767, 0, -32768, 0], [0, 16384, 0, 0]]
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .chain(vec![0; 60])
        .collect();
    let quantised = r#""bufferView":3,"componentType":5122,"normalized":true"#;
    let used =
        r#","extensionsUsed":["KHR_mesh_quantization"],"extensionsRequired":["KHR_mesh_quantization"]"#;
    let read = triangle(quantised, "}}", "", used, &shorts).unwrap().positions;
    assert_eq!((read[1], (read[2][1] - 0.5).abs() < 1e-4), ([1.0, 0.0, -1.0], true));

    // Two of three items differ from zero: indices at 72, values where the corners are.
    let sparse = [floats(&corners), vec![0; 36], vec![1, 2, 0, 0], vec![0; 8]].concat();
    let accessor = r#""componentType":5126,"sparse":{"count":2,"indices":{"bufferView":2,"componentType":5121},
                      "values":{"bufferView":0,"byteOffset":12}}"#;
    assert_eq!(
        triangle(accessor, "}}", "", "", &sparse).unwrap().positions,
        corners.map(|p| p.map(f64::from))
    );

    // A skin whose one joint is the second node.
    let skinned = [floats(&corners), vec![0; 36], [255u8, 0, 0, 0].repeat(3)].concat();
    let attributes = r#","JOINTS_0":2,"WEIGHTS_0":3}}"#;
    let skin = r#","skins":[{"joints":[1]}]"#;
    let read = triangle(plain, attributes, r#","skin":0"#, skin, &skinned).unwrap().positions;
    assert!((read[1][0] - 0.02).abs() < 1e-12 && (read[2][1] - 1.04).abs() < 1e-12, "{read:?}");
}
