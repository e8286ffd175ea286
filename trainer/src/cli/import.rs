//! `clothcombo import`: other people's files become this project's bodies, garments and motions.

use crate::cli::values::{file_to_make, folder_to_make, not_negative, positive};
use crate::cli::verbosity::progress_bar;
use crate::dataset::load_body;
use clap::{Args, Subcommand, ValueEnum};
use clothcombo_data::asset::{Body, BodyFileSettings, Provenance};
use clothcombo_data::import::{
    AmassSettings, AmcSettings, Cloth3dBodies, Cloth3dSettings, RetargetSettings, Thinning, WorldUp,
    import_amass, import_amc, import_bvh, import_cloth3d, import_deepmimic, import_smpl_family,
};
use miette::{IntoDiagnostic, Report};
use std::path::PathBuf;

/// Converts bodies, garments and motions
#[derive(Subcommand)]
pub enum ImportSource {
    /// Motion capture in BVH files
    #[command(
        after_help = "Example:\n  clothcombo import bvh 01_01.bvh 01_03.bvh --body datasets/open/body.npz -o datasets/open/motions\n\n\
            Known are the joint names of Mixamo, Rokoko, Xsens, Perception Neuron, OptiTrack, CMU, LAFAN1, Bandai-Namco, 3ds Max,\n\
            Unreal, Blender and their like, with any prefix. For others --joints names the joints of the rig, one a line:\n  \
            left_hip = \"LThigh\"\nWithout it, the refusal of a file prints one to fill in. FBX: export BVH (Blender, Maya, MotionBuilder)."
    )]
    Bvh(BvhArguments),
    /// Motion capture in ASF/AMC files, as the CMU Graphics Lab Motion Capture Database has it
    #[command(
        visible_alias = "asf",
        after_help = "Examples:\n  clothcombo import amc cmu/subjects --body datasets/open/body.npz -o datasets/open/motions\n  clothcombo import amc walk.amc --skeleton actor.asf --rate 60 -o motions\n\n\
            The skeleton is the .asf in the folder of each .amc: the only one, or the one that its name begins with. Joints are known\n\
            by their names, as in BVH; for others --joints names the joints of the rig, one a line:\n  left_hip = \"lfemur\""
    )]
    Amc(AmcArguments),
    /// Body model from an SMPL, SMPL-H or SMPL-X npz
    #[command(
        visible_aliases = ["smpl", "smplh"],
        after_help = "Examples:\n  clothcombo import smplx SMPLX_NEUTRAL.npz -o datasets/smplx/body.npz\n  clothcombo import smplh smplh/female/model.npz -o datasets/smplh/female.npz\nSMPL's pickles: python3 scripts/smpl_pickle_to_npz.py basicModel_neutral.pkl smpl_neutral.npz, then import that."
    )]
    Smplx(SmplxArguments),
    /// Motions of AMASS and other SMPL tools (npz)
    #[command(
        after_help = "Examples:\n  clothcombo import amass AMASS/CMU AMASS/KIT -o datasets/amass/motions --frame-rate 30\n  clothcombo import amass aist/*.npz --rate 60 -o datasets/aist/motions\n\n\
            Read are poses, full_pose and smpl_poses (frames x 3J or frames x J x 3, 22 joints or more), and body_pose or pose_body\n\
            with global_orient or root_orient, as rotation vectors or matrices; the rate is mocap_framerate, mocap_frame_rate, fps,\n\
            framerate, frame_rate or rate. Pickled arrays are never executed."
    )]
    Amass(AmassArguments),
    /// Garments and poses of CLOTH3D and CLOTH3D++ sample folders
    #[command(
        after_help = "Example:\n  clothcombo import cloth3d CLOTH3D/train --body smpl_neutral.npz --female smpl_female.npz --male smpl_male.npz -o datasets/cloth3d"
    )]
    Cloth3d(Cloth3dArguments),
    /// DeepMimic motion texts (humanoid3d_*.txt)
    #[command(
        after_help = "Example:\n  clothcombo import deepmimic motions/humanoid3d_*.txt --body datasets/open/body.npz -o datasets/open/motions"
    )]
    Deepmimic(DeepmimicArguments),
}

/// What all recordings of a rig need to be moved to a body.
#[derive(Args)]
struct RigArguments {
    /// Body whose skeleton the motions are moved to: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// Frames per second kept
    #[arg(long, visible_alias = "fps", default_value_t = 60.0, value_parser = positive)]
    frame_rate: f64,
    /// TOML file that names the joint of the rig for each body joint, for rigs whose names are not known
    #[arg(long, value_name = "FILE")]
    joints: Option<PathBuf>,
    #[command(flatten)]
    provenance: ProvenanceArguments,
    /// Folder to write
    #[arg(short, long, value_parser = folder_to_make())]
    output: PathBuf,
}

impl RigArguments {
    fn settings(&self) -> RetargetSettings {
        RetargetSettings {
            thinning: Thinning { frame_rate: self.frame_rate, static_threshold: 0.0 },
            provenance: self.provenance.provenance(),
            body_file: Some(PathBuf::from(&self.body)),
        }
    }
}

/// Arguments of `import bvh`.
#[derive(Args)]
pub struct BvhArguments {
    /// BVH files
    #[arg(required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    rig: RigArguments,
}

/// Arguments of `import amc`.
#[derive(Args)]
pub struct AmcArguments {
    /// AMC files, or folders that are searched for them
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Skeleton (.asf) of all motions [default: the one in the folder of each]
    #[arg(long, value_name = "FILE")]
    skeleton: Option<PathBuf>,
    /// Frame rate of the motions, whose files do not say it (frames/s)
    #[arg(long, value_name = "HZ", default_value_t = 120.0, value_parser = positive)]
    rate: f64,
    #[command(flatten)]
    rig: RigArguments,
}

/// Where motions come from, for their files and the manifest.
#[derive(Args)]
struct ProvenanceArguments {
    /// Where the motions come from; without it the name of each file
    #[arg(long, default_value = "", hide_default_value = true)]
    source: String,
    /// Whom to attribute
    #[arg(long, default_value = "", hide_default_value = true)]
    author: String,
    /// Licence of the motions
    #[arg(long, default_value = "", hide_default_value = true)]
    licence: String,
}

impl ProvenanceArguments {
    fn provenance(&self) -> Provenance {
        Provenance { source: self.source.clone(), author: self.author.clone(), licence: self.licence.clone() }
    }
}

/// Arguments of `import smplx`.
#[derive(Args)]
pub struct SmplxArguments {
    /// The model
    input: PathBuf,
    /// Shape components kept, 0 for all
    #[arg(long, default_value_t = 16)]
    components: usize,
    /// Body npz to write
    #[arg(short, long, value_parser = file_to_make())]
    output: PathBuf,
}

/// Which frames of motions are kept.
#[derive(Args)]
pub struct ThinningArguments {
    /// Frames per second kept
    #[arg(long, visible_alias = "fps", default_value_t = 30.0, value_parser = positive)]
    frame_rate: f64,
    /// Drop frames that differ from the last one kept by less than this in every joint (degrees): enough to train on, but slow
    /// movement then plays faster; 0 keeps all, and with them the timing
    #[arg(long, default_value_t = 0.5, value_parser = not_negative)]
    static_threshold: f64,
}

impl ThinningArguments {
    fn thinning(&self) -> Thinning {
        Thinning { frame_rate: self.frame_rate, static_threshold: self.static_threshold.to_radians() }
    }
}

/// The world's up axis.
#[derive(Clone, Copy, ValueEnum)]
pub enum Up {
    /// The axis along which the bodies of an input stand on average; refused where that is not plain
    Auto,
    /// y, as in AIST++
    Y,
    /// z, as in AMASS
    Z,
    /// -y: the coordinates of a camera, as in 4D-Humans
    YDown,
}

impl Up {
    fn axis(self) -> Option<WorldUp> {
        match self {
            Self::Auto => None,
            Self::Y => Some(WorldUp::Y),
            Self::Z => Some(WorldUp::Z),
            Self::YDown => Some(WorldUp::YDown),
        }
    }
}

/// Arguments of `import amass`.
#[derive(Args)]
pub struct AmassArguments {
    /// Files, or folders that are searched for .npz
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    #[command(flatten)]
    thinning: ThinningArguments,
    /// Frame rate of files that do not say theirs (frames/s); a file that says another one is skipped
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate: Option<f64>,
    /// Which axis is up in the files
    #[arg(long, value_enum, default_value = "auto")]
    up: Up,
    /// Folder to write
    #[arg(short, long, value_parser = folder_to_make())]
    output: PathBuf,
}

/// Arguments of `import cloth3d`.
#[derive(Args)]
pub struct Cloth3dArguments {
    /// Sample folders (with info.mat), or folders of them
    #[arg(required = true)]
    samples: Vec<PathBuf>,
    /// Body the garments are for, SMPL or SMPL-H as imported by `import smplx`
    #[arg(long)]
    body: String,
    /// Body of female samples, the same model [default: the body itself]
    #[arg(long)]
    female: Option<String>,
    /// Body of male samples, the same model [default: the body itself]
    #[arg(long)]
    male: Option<String>,
    #[command(flatten)]
    thinning: ThinningArguments,
    /// Folder to write
    #[arg(short, long, value_parser = folder_to_make())]
    output: PathBuf,
}

/// Arguments of `import deepmimic`.
#[derive(Args)]
pub struct DeepmimicArguments {
    /// Motion texts
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Body whose skeleton the motions are moved to: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    #[command(flatten)]
    thinning: ThinningArguments,
    #[command(flatten)]
    provenance: ProvenanceArguments,
    /// Folder to write
    #[arg(short, long, value_parser = folder_to_make())]
    output: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// When an input cannot be read or an output not be written; the message names the file.
pub fn run(source: &ImportSource) -> Result<(), Report> {
    let bar = progress_bar(0, "{msg} {bar:40} {pos}/{len}");
    let mut progress = |what: &str, done: usize, total: usize| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(what.to_owned());
    };
    let summary = match source {
        ImportSource::Bvh(BvhArguments { files, rig }) => {
            let body = load_body(&rig.body, 0)?;
            let joints = rig.joints.as_deref();
            import_bvh(files, &body, &rig.output, &rig.settings(), joints, &mut progress).into_diagnostic()?
        }
        ImportSource::Amc(AmcArguments { inputs, skeleton, rate, rig }) => {
            let body = load_body(&rig.body, 0)?;
            let settings = AmcSettings { retarget: rig.settings(), rate: *rate, skeleton: skeleton.clone() };
            let joints = rig.joints.as_deref();
            import_amc(inputs, &body, &rig.output, &settings, joints, &mut progress).into_diagnostic()?
        }
        ImportSource::Smplx(a) => {
            let limit = if a.components == 0 { usize::MAX } else { a.components };
            let settings = BodyFileSettings { shape_components: limit };
            import_smpl_family(&a.input, &a.output, &settings, &mut progress).into_diagnostic()?
        }
        ImportSource::Amass(a) => {
            let settings = AmassSettings { thinning: a.thinning.thinning(), up: a.up.axis(), rate: a.rate };
            import_amass(&a.inputs, &a.output, &settings, &mut progress).into_diagnostic()?
        }
        ImportSource::Cloth3d(a) => {
            let target = load_body(&a.body, 0)?;
            let gendered = |file: &Option<String>| -> Result<Option<Body>, Report> {
                Ok(file.as_deref().map(|f| load_body(f, 0)).transpose()?)
            };
            let (female, male) = (gendered(&a.female)?, gendered(&a.male)?);
            let bodies = Cloth3dBodies { target: &target, female: female.as_ref(), male: male.as_ref() };
            let settings = Cloth3dSettings {
                thinning: a.thinning.thinning(),
                body_files: [Some(&a.body), a.female.as_ref(), a.male.as_ref()]
                    .into_iter()
                    .flatten()
                    .map(PathBuf::from)
                    .collect(),
                ..Cloth3dSettings::default()
            };
            import_cloth3d(&a.samples, &bodies, &a.output, &settings, &mut progress).into_diagnostic()?
        }
        ImportSource::Deepmimic(a) => {
            let body = load_body(&a.body, 0)?;
            let provenance = a.provenance.provenance();
            let body_file = Some(PathBuf::from(&a.body));
            let settings = RetargetSettings { thinning: a.thinning.thinning(), provenance, body_file };
            import_deepmimic(&a.files, &body, &a.output, &settings, &mut progress).into_diagnostic()?
        }
    };
    bar.finish_and_clear();
    println!("{summary}");
    Ok(())
}
