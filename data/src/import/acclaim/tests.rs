use super::*;
use crate::asset::rotation::apply;

const ARM_AND_LEG: &str = "# made by hand
:version 1.10
:units
  length 0.45
  angle deg
:documentation
  begin of what is not read
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     name toes
     direction 0 0 1
     length 1
     axis -90 0 20 XYZ
  end
  begin
     name collar
     direction 0.6 0.8 0
     length 5
     axis 0 0 0 XYZ
  end
  begin
     name humerus
     direction 1 0 0
     length 3
     axis 180 -30 -90 XYZ
    dof rx ry rz
    limits (-60.0 90.0)
           (-90.0 90.0)
           (-90.0 90.0)
  end
  begin
     name radius
     direction 1 0 0
     length 2
     axis 180 -30 -90 XYZ
    dof rx
  end
  begin
     name foot
     length 10
     direction 0 -0.6 0.8
     axis -90 0 20 XYZ
    dof rx rz
  end
:hierarchy
  begin
    root collar foot
    humerus radius
    collar humerus
    foot toes
  end
";
const MOTION: &str = "#!OML:ASF made.ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 10 -20 30
humerus 17 -14 62
radius 136
foot -15 7
2
root 0 0 0 0 0 0
humerus 0 0 0
radius 90
foot 20 0
";

fn parse(skeleton: &str, motion: &str) -> Result<Recording, String> {
    let bones = AcclaimSkeleton::parse(skeleton, Path::new("01.asf")).map_err(|e| e.to_string())?;
    let values = motion::parse(motion, Path::new("01_01.amc"), &bones).map_err(|e| e.to_string())?;
    Ok(Recording::new(bones.joints(), 120.0, values))
}

/// Where the joints are in a frame, by their bones, the root at 0.
fn joints(recording: &Recording, frame: usize) -> Vec<(&str, [f64; 3])> {
    let world = recording.world_rotations(frame);
    let mut at: Vec<[f64; 3]> = Vec::new();
    for joint in &recording.joints {
        let turned = joint.parent.map_or([0.0; 3], |p| apply(&world[p], joint.offset));
        let parent = joint.parent.map_or([0.0; 3], |p| at[p]);
        at.push(std::array::from_fn(|a| parent[a] + turned[a]));
    }
    recording.joints.iter().map(|joint| joint.name.as_str()).zip(at).collect()
}

/// Numbers of an independent computation: from the leaves to the root, each joint turned, with all that hangs on it, about
/// axes fixed at rest.
#[test]
fn joints_are_where_they_belong() {
    let recording = parse(ARM_AND_LEG, MOTION).unwrap();
    assert_eq!(recording.frame_count(), 2);
    let expected = [
        [
            ("humerus", [0.266040474, 4.70223071, 1.678764075]),
            ("radius", [1.797497372, 3.065859779, 3.672988221]),
            ("toes", [0.214381741, -5.718399505, 8.200850417]),
        ],
        [
            ("humerus", [3.0, 4.0, 0.0]),
            ("radius", [6.0, 4.0, 0.0]),
            ("toes", [0.819527719, -8.251633903, 5.589178137]),
        ],
    ];
    for (frame, expected) in expected.iter().enumerate() {
        let found = joints(&recording, frame);
        for (name, expected) in expected {
            let (_, place) = found.iter().find(|(joint, _)| joint == name).unwrap();
            assert!(place.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-8), "{name}: {place:?}");
        }
    }
    // Of the forearm, its direction.
    for (frame, end) in [[0.021092758, 3.983558888, 3.625924527], [6.0, 5.0, 1.732050808]].iter().enumerate()
    {
        let radius = recording.joint("radius").unwrap();
        let along = apply(&recording.world_rotations(frame)[radius], [2.0, 0.0, 0.0]);
        let start = joints(&recording, frame)[radius].1;
        assert!((0..3).all(|a| (start[a] + along[a] - end[a]).abs() < 1e-8), "{start:?} {along:?}");
    }
}

#[test]
fn units_and_the_order_of_the_root_are_respected() {
    let degrees = parse(ARM_AND_LEG, MOTION).unwrap();
    // The root's values in another order, and turned at rest.
    let other = ARM_AND_LEG
        .replace("order TX TY TZ RX RY RZ", "order rz rx ry tx")
        .replace("orientation 0 0 0", "orientation 0 -30 0");
    let root = |values: &str| {
        let motion =
            MOTION.replace("root 1 2 3 10 -20 30", values).replace("root 0 0 0 0 0 0", "root 0 0 0 0");
        parse(&other, &motion).unwrap().world_rotations(0)
    };
    let same = |a: &[[[f64; 3]; 3]], b: &[[[f64; 3]; 3]]| {
        a.as_flattened()
            .as_flattened()
            .iter()
            .zip(b.as_flattened().as_flattened())
            .all(|(a, b)| (a - b).abs() < 1e-9)
    };
    assert!(same(&root("root 30 10 10 5"), &degrees.world_rotations(0)));
    assert!(!same(&root("root 30 10 11 5"), &degrees.world_rotations(0)));
    let in_radians: String = MOTION
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let mut words = line.split(' ');
            let name = words.next().unwrap();
            let values = words.map(|w| format!(" {:.12}", w.parse::<f64>().unwrap().to_radians()));
            format!("{}{}\n", name.replace(":DEGREES", ":RADIANS"), values.collect::<String>())
        })
        .collect();
    assert!(same(&parse(ARM_AND_LEG, &in_radians).unwrap().world_rotations(0), &degrees.world_rotations(0)));
}

#[test]
fn defects_of_skeletons_name_their_line() {
    for (from, to, line, part) in [
        ("angle deg", "angle turns", 5, "'turns' is no unit of angles"),
        ("order TX TY TZ RX RY RZ", "order TX TY TZ RX RY RW", 9, "'RW' is no degree of freedom"),
        ("axis XYZ", "axis XYY", 10, "'XYY' is no order of axes"),
        ("direction 0 0 1\n", "direction 0 0\n", 16, "'direction' takes 3 numbers, found 2"),
        ("length 5", "length x", 23, "'x' is not a finite number (length)"),
        ("axis 180 -30 -90 XYZ\n    dof rx\n", "dof rx\n", 41, "line 36 has no 'axis'"),
        ("name collar", "name foot", 49, "two bones 'foot'"),
        ("dof rx rz", "dof rx rx", 48, "'rx' is there twice"),
        ("    foot toes\n", "", 14, "bone 'toes' does not hang on the root"),
        ("foot toes", "foot toes radius", 55, "'radius' hangs on 'humerus' already (line 53)"),
        ("foot toes", "foot toes nose", 55, "no bone is called 'nose'"),
        ("foot toes", "foot\n    toes collar", 56, "'collar' hangs on 'root' already"),
        (":hierarchy", ":family", 14, "does not hang on the root"),
        ("  order TX TY TZ RX RY RZ", "", 56, "no ':root' with 'order'"),
        (":version 1.10\n", "x\n", 2, "an ASF file begins with :version"),
    ] {
        let message = parse(&ARM_AND_LEG.replacen(from, to, 1), MOTION).unwrap_err();
        assert!(
            message.starts_with(&format!("01.asf:{line}: ")) && message.contains(part),
            "{to}: {message}"
        );
    }
    let cut = &ARM_AND_LEG[..ARM_AND_LEG.find("name foot").unwrap()];
    assert!(parse(cut, MOTION).unwrap_err().contains("the file ends within the bone"));
}

#[test]
fn defects_of_motions_name_their_line() {
    for (from, to, line, part) in [
        (
            "radius 136\n",
            "",
            4,
            "frame 1 has no values of 'radius', which moves in 01.asf; is the file truncated?",
        ),
        ("foot 20 0\n", "", 9, "frame 2 has no values of 'foot'"),
        ("radius 136", "radius 136 2", 7, "'radius' has 2 values for 1 degrees of freedom"),
        ("radius 136", "radius nan", 7, "'nan' is not a finite number (radius)"),
        ("radius 136", "radius 1e20", 7, "turns by"),
        ("radius 136", "radium 136", 7, "no bone of 01.asf is called 'radium'"),
        ("radius 136", "radius 1\nradius 2", 8, "'radius' is there twice in frame 1"),
        ("radius 136", "toes 1\nradius 136", 7, "'toes' has 1 values for 0 degrees"),
        ("1\nroot", "root", 4, "before the number of the first frame"),
    ] {
        let message = parse(ARM_AND_LEG, &MOTION.replacen(from, to, 1)).unwrap_err();
        assert!(
            message.starts_with(&format!("01_01.amc:{line}: ")) && message.contains(part),
            "{to}: {message}"
        );
    }
    assert!(parse(ARM_AND_LEG, ":DEGREES\n").unwrap_err().contains("01_01.amc: no frames"));
}

#[test]
fn the_skeleton_is_the_only_one_or_the_one_that_begins_the_name() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    assert!(skeleton_beside(&file("01_02.amc")).unwrap_err().contains("--skeleton FILE"));
    fs::write(file("only.ASF"), "").unwrap();
    assert_eq!(skeleton_beside(&file("01_02.amc")), Ok(file("only.ASF")));
    fs::write(file("01.asf"), "").unwrap();
    assert_eq!(skeleton_beside(&file("01_02.amc")), Ok(file("01.asf")));
    assert!(skeleton_beside(&file("03_02.amc")).unwrap_err().contains("none of the 2 skeletons"));
}
