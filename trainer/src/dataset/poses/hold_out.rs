//! Which frames of the clips are held out of training, where clips are long, where all are short, and where there is but one.

use crate::config::PoseConfig;
use crate::dataset::split::place;
use clothcombo_data::asset::Motion;

/// What a frame of a clip is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    Training,
    HeldOut,
    /// Too near to a held-out frame to train on.
    Margin,
}

/// Windows that hold out less than this part of `held_out_share` are too few to validate on; whole clips join them.
const ENOUGH_IN_WINDOWS: f64 = 0.25;
/// Whole clips are held out of at most this part of the time of all.
const MOST_WHOLE: f64 = 1.0 / 3.0;
/// The shortest window that a short clip is given (s).
const SHORTEST_WINDOW: f64 = 0.1;

/// The purposes of the frames of all clips, and what was done where no clip has room for a window, in words.
pub(super) struct HeldOutFrames {
    pub purposes: Vec<Vec<Purpose>>,
    pub note: Option<String>,
}

/// First frame, and the one after the last, of every run of frames that are for `wanted`.
pub(super) fn runs_of(purposes: &[Purpose], wanted: Purpose) -> Vec<[usize; 2]> {
    let mut start = 0;
    let mut runs = Vec::new();
    for run in purposes.chunk_by(|a, b| a == b) {
        let end = start + run.len();
        if run[0] == wanted {
            runs.push([start, end]);
        }
        start = end;
    }
    runs
}

/// Every clip is cut into blocks; one block in every `1 / held_out_share`, in the middle of its group, is held out. A
/// clip of less than about half a group has none. Frames within `held_out_margin` of a held-out one are for nothing.
///
/// Where that holds out less than a quarter of the share, clips without a window are held out whole, in the order of a
/// hash of their names, until the share is reached: at most a third of the time of all. Where a third is too little for
/// any, every clip has a window in its middle, with block and margin scaled down to its length, as long as the block is
/// 0.1 s or more.
pub(super) fn hold_out(clips: &[&Motion], config: &PoseConfig) -> HeldOutFrames {
    let mut purposes: Vec<Vec<Purpose>> = clips
        .iter()
        .map(|clip| in_blocks(clip, config.held_out_block, config.held_out_margin, config))
        .collect();
    let seconds: Vec<f64> = clips.iter().map(|clip| clip.poses.len() as f64 / clip.frame_rate).collect();
    let held_out = |purposes: &[Vec<Purpose>]| -> f64 {
        let count = |p: &Vec<Purpose>| p.iter().filter(|p| **p == Purpose::HeldOut).count();
        purposes.iter().zip(clips).map(|(p, clip)| count(p) as f64 / clip.frame_rate).sum()
    };
    let total: f64 = seconds.iter().sum();
    let wanted = total / config.blocks_per_window() as f64;
    let in_windows = held_out(&purposes);
    if in_windows.is_nan() || in_windows >= ENOUGH_IN_WINDOWS * wanted {
        return HeldOutFrames { purposes, note: None };
    }
    let whole = whole_clips(clips, &seconds, &purposes, in_windows, wanted, MOST_WHOLE * total);
    for clip in &whole {
        purposes[*clip].fill(Purpose::HeldOut);
    }
    if !whole.is_empty() {
        let names: Vec<&str> = whole.iter().map(|clip| clips[*clip].name.as_str()).collect();
        let note = format!(
            "most clips are too short for a held-out window ({} s and more have one); held out whole: {}",
            config.held_out_block * (config.blocks_per_window() / 2) as f64,
            names.join(", ")
        );
        return HeldOutFrames { purposes, note: Some(note) };
    }
    if in_windows > 0.0 {
        return HeldOutFrames { purposes, note: None };
    }
    let mut widest: f64 = 0.0;
    for (clip, purposes) in clips.iter().zip(&mut purposes) {
        let block = clip.poses.len() as f64 / clip.frame_rate / config.blocks_per_window() as f64;
        if block >= SHORTEST_WINDOW {
            let margin = config.held_out_margin * block / config.held_out_block;
            *purposes = in_blocks(clip, block, margin, config);
            widest = widest.max(margin);
        }
    }
    let note = (held_out(&purposes) > 0.0).then(|| {
        format!(
            "the clips are too few to hold one out, and too short for a window of {} s: the windows are shorter, and held-out poses \
             come within {widest:.2} s of trained ones; scores on them flatter",
            config.held_out_block
        )
    });
    HeldOutFrames { purposes, note }
}

/// The clips without a window that are held out whole, so that `wanted` seconds are held out together with those `in_windows`.
fn whole_clips(
    clips: &[&Motion],
    seconds: &[f64],
    purposes: &[Vec<Purpose>],
    in_windows: f64,
    wanted: f64,
    most: f64,
) -> Vec<usize> {
    let is_short = |clip: &usize| {
        !purposes[*clip].is_empty() && purposes[*clip].iter().all(|purpose| *purpose == Purpose::Training)
    };
    let mut short: Vec<usize> = (0..clips.len()).filter(is_short).collect();
    short.sort_by(|a, b| place(&clips[*a].name).total_cmp(&place(&clips[*b].name)));
    let mut together = in_windows;
    let mut whole = Vec::new();
    for &clip in &short {
        if together + seconds[clip] <= wanted {
            together += seconds[clip];
            whole.push(clip);
        }
    }
    // All may be longer than the share: then the one that comes nearest to it.
    if together < 0.5 * wanted {
        let miss = |clip: usize| (together + seconds[clip] - wanted).abs();
        let left =
            short.into_iter().filter(|clip| !whole.contains(clip) && together + seconds[*clip] <= most);
        whole.extend(left.min_by(|a, b| miss(*a).total_cmp(&miss(*b))));
    }
    whole
}

/// The purposes of the frames of one clip, in blocks of `block` seconds.
fn in_blocks(clip: &Motion, block: f64, margin: f64, config: &PoseConfig) -> Vec<Purpose> {
    let (count, frame_rate) = (clip.poses.len(), clip.frame_rate);
    let block = ((block * frame_rate).round() as usize).max(1);
    let group = config.blocks_per_window();
    let held_out = |frame: usize| frame / block % group == group / 2;
    let mut purposes = vec![Purpose::Training; count];
    // A trained frame is at least so many frames from any held-out one.
    let distance = (margin * frame_rate).ceil() as usize;
    let reach = distance.saturating_sub(1);
    for frame in (0..count).filter(|frame| held_out(*frame)) {
        purposes[frame] = Purpose::HeldOut;
    }
    for [start, end] in runs_of(&purposes, Purpose::HeldOut) {
        let around = [start.saturating_sub(reach)..start, end..end.saturating_add(reach).min(count)];
        for frame in around.into_iter().flatten().filter(|frame| !held_out(*frame)) {
            purposes[frame] = Purpose::Margin;
        }
    }
    purposes
}

/// What to set so that `clips`, all of them too short, are split; none if there is nothing to set.
pub(super) fn remedy(clips: &[&Motion], config: &PoseConfig) -> String {
    let more = format!(
        "add clips: one of {:.1} s is split, and of several, one that is at most a third of the time of all is held out whole",
        SHORTEST_WINDOW * config.blocks_per_window() as f64
    );
    let longest = clips.iter().max_by_key(|clip| clip.poses.len());
    let Some(clip) = longest.filter(|clip| clip.poses.len() > 1) else { return more };
    let frames = clip.poses.len();
    // Blocks of whole frames, the held-out one of them within the clip.
    let of = |group: usize| (frames / (group / 2 + 1), group);
    let (share, block) = match of(config.blocks_per_window()) {
        (0, _) => ("held_out_share = 0.5, ".to_owned(), of(2).0),
        (block, _) => (String::new(), block),
    };
    let seconds = block as f64 / clip.frame_rate;
    format!("set {share}held_out_block = {seconds:.4} and held_out_margin = 0 in [data.poses], or {more}")
}

#[cfg(test)]
mod tests;
