//! What tobj is given, and what it makes of it.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use super::super::triangles;
use super::*;

fn file() -> Arc<Path> {
    Path::new("a.obj").into()
}

fn checked(text: &str) -> ObjText<'_> {
    check(&file(), text.as_bytes()).expect("valid")
}

fn meshes(text: &str) -> Vec<tobj::Mesh> {
    let obj = checked(text);
    triangles(&file(), &obj.text, &obj.survey).expect("readable by tobj")
}

fn problem(text: &str) -> String {
    check(&file(), text.as_bytes()).expect_err("refused").to_string()
}

const THREE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn a_plain_file_is_given_to_tobj_as_it_is() {
    let text = format!("{THREE}vt 0 0\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 3/1/1\nf -3//-1 -2//-1 -1//-1\n");
    assert!(matches!(
        checked(&text.replace("f -", "g b\nf -")).text,
        Cow::Borrowed(_)
    ));
}

#[test]
fn corners_with_and_without_normals_in_one_group_keep_their_own() {
    let text = format!("{THREE}vn 0 0 1\nf 1//1 2//1 3//1\nf 3 2 1\n");
    let meshes = meshes(&text);
    let [mesh] = &meshes[..] else {
        panic!("one mesh, not {}", meshes.len())
    };
    assert_eq!(mesh.indices.len(), 6);
    assert_eq!(mesh.normals.len(), mesh.positions.len());
    let normal_z = |corner: usize| mesh.normals[3 * mesh.indices[corner] as usize + 2];
    let normals: Vec<f32> = (0..6).map(normal_z).collect();
    assert_eq!(normals, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
}

#[test]
fn indices_that_count_back_mean_the_last_so_far() {
    let text = format!("{THREE}v 9 9 9\nf -4 -3 -2\nv 5 5 5\nf -5 -4 -3\n");
    let positions = &meshes(&text)[0].positions;
    assert!(!positions.contains(&9.0), "{positions:?}");
    assert_eq!(meshes(&text)[0].indices, [0, 1, 2, 0, 1, 2]);
}

#[test]
fn polylines_and_points_are_no_triangles() {
    let text = format!("{THREE}l 1 2 3\np 1 2 3\nf 1 2 3\n");
    assert_eq!(meshes(&text)[0].indices.len(), 3);
}

#[test]
fn colours_comments_and_short_texture_coordinates_are_understood() {
    let text = "v 0 0 0 1 0 0 # red\nv 1 0 0\nv 0 1 0 0 0 1 1\nvt 0.5\nf 1/1 2/1 3/1 # front\n";
    let meshes = meshes(text);
    assert_eq!(meshes[0].positions, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    assert_eq!(meshes[0].texcoords, [0.5, 0.0, 0.5, 0.0, 0.5, 0.0]);
}

#[test]
fn a_face_may_go_on_after_a_backslash() {
    let text = format!("{THREE}f 1 2 \\\n 3\n");
    assert_eq!(meshes(&text)[0].indices.len(), 3);
}

#[test]
fn polygons_become_fans() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 1 0\nf 1 2 3 4 5\n";
    assert_eq!(meshes(text)[0].indices, [0, 1, 2, 0, 2, 3, 0, 3, 4]);
    assert_eq!(checked(text).survey.triangles, 3);
}

#[test]
fn materials_are_told_apart_by_name_even_if_no_library_has_them() {
    let text = format!("{THREE}f 1 2 3\nusemtl b\nf 1 2 3\n  usemtl\ta\nf 1 2 3\nusemtl b\nf 1 2 3\n");
    let ids: Vec<_> = meshes(&text).iter().map(|mesh| mesh.material_id).collect();
    assert_eq!(ids, [None, Some(0), Some(1), Some(0)]);
    let survey = checked(&text).survey;
    assert_eq!(survey.materials, [("b".into(), 6), ("a".into(), 8)]);
    assert_eq!(survey.triangles_without_material, 1);
}

#[test]
fn a_material_without_faces_is_not_used() {
    let text = format!("{THREE}usemtl a\nusemtl b\nf 1 2 3\n");
    assert_eq!(checked(&text).survey.materials, [("b".into(), 6)]);
}

#[test]
fn lines_that_are_not_obj_are_counted() {
    let text = format!("# c\n#c\ns off\n{THREE}vertex 1\nvertex 2\nf 1 2 3\n");
    assert_eq!(checked(&text).survey.unknown, Some((2, "vertex".into(), 7)));
}

#[test]
fn numbers_that_are_not_finite_are_counted_unless_they_are_positions() {
    let text = format!("{THREE}vt nan 0\nvn 0 inf 0\nvn 0 1e99 0\nf 1 2 3\n");
    assert_eq!(checked(&text).survey.not_finite, Some((3, 4)));
    assert!(problem("v 0 0 0\nv 0 nan 0\n").starts_with("a.obj:2: the vertex is not finite"));
    assert!(problem("v 1e39 0 0\n").contains("not finite"));
    assert!(problem("v 1 0 0 0\n").contains("not finite"));
    assert!(problem("v 1e10 0 0\n").contains("beyond"));
}

#[test]
fn the_first_wrong_line_is_named() {
    let problem = |line: &str| problem(&format!("{THREE}vt 0 0\nvn 0 0 1\n{line}\nv x\n"));
    assert_eq!(problem("v 1 2"), "a.obj:6: a vertex needs 3 numbers, not 2");
    assert_eq!(problem("v 1 2 three"), "a.obj:6: `three` is not a number");
    assert_eq!(problem("vn 1 2"), "a.obj:6: a normal needs 3 numbers, not 2");
    assert_eq!(
        problem("vt"),
        "a.obj:6: a texture coordinate needs 1 numbers, not 0"
    );
    assert_eq!(
        problem("f 1 2"),
        "a.obj:6: a face needs at least three vertices, not 2"
    );
    assert_eq!(
        problem("f"),
        "a.obj:6: a face needs at least three vertices, not 0"
    );
    assert_eq!(problem("f 1 2 x"), "a.obj:6: `x` is not a vertex of a face");
    assert_eq!(problem("f 1 2 /1"), "a.obj:6: `/1` is not a vertex of a face");
    assert!(problem("f 1 2 3/1/1/1").contains("more than three indices"));
    assert!(problem("usemtl").contains("`usemtl` without a name"));
    assert!(problem("mtllib ").contains("`mtllib` without a file name"));
}

#[test]
fn an_index_out_of_range_is_named() {
    let problem = |face: &str| problem(&format!("{THREE}vt 0 0\nvn 0 0 1\nf 1 2 {face}\n"));
    let range = "is out of range: 3 are defined above this line, counted from 1";
    for index in ["4", "0", "-4", "9223372036854775807", "-9223372036854775808"] {
        assert_eq!(problem(index), format!("a.obj:6: vertex index {index} {range}"));
    }
    assert!(problem("3/2").contains("texture coordinate index 2 is out of range: 1 are"));
    assert!(problem("3//3074457345618258603").contains("normal index 3074457345618258603 is out"));
    assert!(problem("99999999999999999999").contains("is not a vertex of a face"));
}
