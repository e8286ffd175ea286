//! Positions of draped garments on the host.

use burn::tensor::{Device, Tensor, TensorData};
use clothcombo_model::DrapeState;

/// Positions of all garments of a scene on its first body, packed inner → outer.
#[derive(Clone, Debug)]
pub struct Draped {
    /// Before skinning (T-pose), `[ΣV, 3]`.
    pub canonical: Vec<[f32; 3]>,
    /// After skinning, `[ΣV, 3]`.
    pub posed: Vec<[f32; 3]>,
}

impl Draped {
    /// A state of the networks on the host.
    pub fn of(state: &DrapeState) -> Self {
        Self { canonical: to_host(state.canonical.clone()), posed: to_host(state.posed.clone()) }
    }
}

/// Positions as a tensor `[N, 3]`.
pub(crate) fn to_device(positions: &[[f32; 3]], device: &Device) -> Tensor<2> {
    let data = TensorData::new(positions.as_flattened().to_vec(), [positions.len(), 3]);
    Tensor::from_data(data, device)
}

/// Positions `[N, 3]` of a tensor.
pub(crate) fn to_host(positions: Tensor<2>) -> Vec<[f32; 3]> {
    let data = positions.into_data();
    let values = data.as_slice::<f32>().expect("positions are f32");
    values.as_chunks::<3>().0.to_vec()
}
