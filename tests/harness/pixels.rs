//! The values of an EXR, for sums that `oiiotool` does not know.

use std::{collections::BTreeMap, path::Path};

use exr::prelude::read_first_flat_layer_from_file;

/// All channels of a picture by name, each `[height][width]`.
#[derive(Debug, Clone)]
pub struct Pixels {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    channels: BTreeMap<String, Vec<f32>>,
}

impl Pixels {
    /// Reads an EXR.
    #[track_caller]
    pub fn read(path: &Path) -> Self {
        let image = read_first_flat_layer_from_file(path);
        let layer = image
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
            .layer_data;
        let channels = layer.channel_data.list.iter().map(|channel| {
            let values = channel.sample_data.values_as_f32().collect();
            (channel.name.to_string(), values)
        });
        Self {
            width: layer.size.width(),
            height: layer.size.height(),
            channels: channels.collect(),
        }
    }

    /// One channel.
    #[track_caller]
    pub fn channel(&self, name: &str) -> &[f32] {
        let names = || self.channels.keys().cloned().collect::<Vec<_>>().join(", ");
        self.channels
            .get(name)
            .unwrap_or_else(|| panic!("no channel {name} among {}", names()))
    }

    /// One channel that holds whole numbers.
    #[track_caller]
    pub fn counts(&self, name: &str) -> Vec<u32> {
        self.channel(name).iter().map(|&value| value as u32).collect()
    }

    /// The mean of one channel.
    #[track_caller]
    pub fn mean(&self, name: &str) -> f64 {
        mean(self.channel(name).iter().copied())
    }

    /// The mean of red, green and blue.
    #[track_caller]
    pub fn mean_radiance(&self) -> f64 {
        ["R", "G", "B"].map(|name| self.mean(name)).iter().sum::<f64>() / 3.0
    }

    /// How many pixels of a channel are greater than zero.
    #[track_caller]
    pub fn count_positive(&self, name: &str) -> usize {
        self.channel(name).iter().filter(|&&value| value > 0.0).count()
    }

    /// The means of red, green and blue together over blocks of `side` × `side` pixels; those that are
    /// cut by the border are left out.
    #[track_caller]
    pub fn block_means(&self, side: usize) -> Vec<f64> {
        let channels = ["R", "G", "B"].map(|name| self.channel(name));
        let block = |row: usize, column: usize| {
            let rows = row * side..(row + 1) * side;
            let values = rows.flat_map(|y| {
                let start = y * self.width + column * side;
                channels
                    .iter()
                    .flat_map(move |channel| channel[start..start + side].iter().copied())
            });
            mean(values)
        };
        let (rows, columns) = (self.height / side, self.width / side);
        (0..rows)
            .flat_map(|row| (0..columns).map(move |column| block(row, column)))
            .collect()
    }
}

fn mean(values: impl Iterator<Item = f32>) -> f64 {
    let (count, sum) = values.fold((0_u32, 0.0), |(count, sum), value| {
        (count + 1, sum + f64::from(value))
    });
    sum / f64::from(count)
}
