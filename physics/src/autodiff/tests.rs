//! The operation against the host functions it wraps, on every backend that is compiled in and needs no special hardware.

use super::*;
use crate::energy::tests::scenes::{paper_weights, scene};
use crate::energy::{EnergySettings, Term, TermMap};
use burn::tensor::Device;

fn devices() -> Vec<(&'static str, Device)> {
    vec![
        #[cfg(feature = "flex")]
        ("flex", Device::flex()),
        #[cfg(feature = "ndarray")]
        #[allow(deprecated)]
        ("ndarray", Device::ndarray()),
    ]
}

fn tensor(positions: &[[f32; 3]], device: &Device) -> Tensor<2> {
    let data = TensorData::new(positions.as_flattened().to_vec(), [positions.len(), 3]);
    Tensor::from_data(data, device)
}

fn entries<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_to_vec().expect("f32")
}

#[test]
fn backward_is_the_host_gradient_times_the_upstream_one() {
    for (name, device) in devices() {
        let device = device.autodiff();
        let s = scene::<f32>(EnergySettings::default(), paper_weights(), 3);
        let expected = s.energy.evaluate(&s.posed, &s.canonical);
        let posed = tensor(&s.posed, &device).require_grad();
        let canonical = tensor(&s.canonical, &device).require_grad();
        let output = scene_loss(posed.clone(), canonical.clone(), Arc::new(s.energy));
        assert_eq!(entries(output.loss.clone()), [expected.total as f32], "{name}");
        let value = output.value();
        assert_eq!(
            (value.total, &value.garments, &value.layers),
            (expected.total, &expected.garments, &expected.layers)
        );
        // Through another operation, so that the upstream gradient is neither 1 nor constant.
        let mut gradients = (output.loss.clone() * output.loss * 0.5).backward();
        for (variable, host) in [(posed, expected.posed_gradient), (canonical, expected.canonical_gradient)] {
            let found = variable.grad_remove(&mut gradients).expect("a gradient");
            for (found, host) in entries(found).into_iter().zip(host.into_flattened()) {
                let host = host * expected.total as f32;
                assert!((found - host).abs() <= 1e-5 * host.abs() + 1e-12, "{name}: {found} {host}");
            }
        }
    }
}

#[test]
fn without_autodiff_the_value_is_the_same() {
    for (name, device) in devices() {
        let s = scene::<f32>(EnergySettings::default(), paper_weights(), 3);
        let expected = s.energy.value(&s.posed, &s.canonical);
        let scene = Arc::new(s.energy);
        // Off the tape, and on it with constants.
        for device in [device.clone(), device.autodiff()] {
            let output = scene_loss(tensor(&s.posed, &device), tensor(&s.canonical, &device), scene.clone());
            assert_eq!(entries(output.loss.clone()), [expected.total as f32], "{name}");
            assert_eq!(output.value(), &expected, "{name}");
        }
    }
}

#[test]
fn a_scene_without_holding_leaves_canonical_positions_alone() {
    for (_, device) in devices() {
        let device = device.autodiff();
        let weights = TermMap::from_fn(|term| if term == Term::Holding { 0.0 } else { 1.0 });
        let s = scene::<f32>(EnergySettings::default(), weights, 3);
        let posed = tensor(&s.posed, &device).require_grad();
        let canonical = tensor(&s.canonical, &device).require_grad();
        let output = scene_loss(posed.clone(), canonical.clone(), Arc::new(s.energy));
        assert!(output.value().garments.iter().all(|raw| raw[Term::Holding].is_none()));
        let gradients = output.loss.backward();
        assert!(posed.grad(&gradients).is_some());
        assert!(canonical.grad(&gradients).is_none());
    }
}

/// Half the squared norm; its gradient is the argument.
#[derive(Debug)]
struct HalfSquare;

impl HostEnergy for HalfSquare {
    fn evaluate(&self, x: &[f32]) -> (f64, Vec<f32>) {
        (x.iter().map(|x| 0.5 * f64::from(*x).powi(2)).sum(), x.to_vec())
    }
}

#[test]
fn any_host_energy_is_part_of_the_graph() {
    for (_, device) in devices() {
        let device = device.autodiff();
        let x = tensor(&[[1.0, 2.0, 3.0], [-1.0, 0.5, 4.0]], &device).require_grad();
        // Behind an operation: ∂/∂x ½|2x|² = 4x. Used twice: gradients add up.
        let doubled = x.clone() * 2.0;
        let energy = Arc::new(HalfSquare);
        let loss = host_energy(doubled.clone(), energy.clone()) + host_energy(doubled, energy);
        let gradients = loss.backward();
        let found = entries(x.grad(&gradients).expect("a gradient"));
        assert_eq!(found, entries(x).iter().map(|x| 8.0 * x).collect::<Vec<_>>());
    }
}
