//! The model that is used when none is named: it is part of the program.

#[cfg(feature = "built-in-model")]
use crate::run::checkpoint::ModelFiles;
use crate::run::checkpoint::TrainedModel;
use miette::Report;

/// `models/default` of the checkout that the program was built from.
#[cfg(feature = "built-in-model")]
static SHIPPED_FILES: ModelFiles = ModelFiles {
    state: include_str!("../../../models/default/state.json"),
    config: include_str!("../../../models/default/config.toml"),
    parameters: include_bytes!("../../../models/default/model.safetensors"),
    body: include_bytes!("../../../models/default/body.npz"),
};

/// Opens the shipped model.
///
/// # Errors
/// When the program was built without it (feature `built-in-model`).
pub fn shipped_model() -> Result<TrainedModel, Report> {
    #[cfg(feature = "built-in-model")]
    return Ok(TrainedModel::built_in(&SHIPPED_FILES)?);
    #[cfg(not(feature = "built-in-model"))]
    Err(miette::miette!(
        help = "name one with --checkpoint: a run of clothcombo-train, or models/default of the project's checkout",
        "no trained model: none was named, and this program was built without one"
    ))
}

#[cfg(all(test, feature = "built-in-model"))]
mod tests {
    use super::*;
    use crate::system::device::default_device;
    use burn::module::Module;
    use std::path::Path;

    #[test]
    fn the_model_of_the_program_is_that_of_the_checkout() {
        let built_in = shipped_model().unwrap();
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
        let opened = TrainedModel::open(&folder).unwrap();
        assert_eq!(built_in.checksum(), opened.checksum());
        assert_eq!(built_in.config.model, opened.config.model);
        let device = default_device();
        let [a, b] = [&built_in, &opened].map(|trained| trained.networks(&device).unwrap());
        assert_eq!(a.num_params(), b.num_params());
        let weight = |model: &clothcombo_model::ClothCombo| {
            model.draping.displacement.output.weight.val().into_data().try_to_vec::<f32>().unwrap()
        };
        assert_eq!(weight(&a), weight(&b));
        let [a, b] = [&built_in, &opened].map(|trained| trained.body().unwrap().unwrap());
        assert!(a.vertex_count() == b.vertex_count() && a.joint_names == b.joint_names);
    }
}
