//! Strews points over the surface of a mesh and writes them: `sample_surface MESH COUNT OUTPUT`.

use std::{env, error::Error, path::PathBuf, time::Instant};

use autosplats_cloud::{ReadOptions, read_mesh, sample_surface, write};

fn main() -> Result<(), Box<dyn Error>> {
    let [mesh, count, output] = env::args().skip(1).collect::<Vec<_>>().try_into().map_err(|_| "MESH COUNT OUTPUT")?;
    let start = Instant::now();
    let mesh = read_mesh(&PathBuf::from(mesh), &ReadOptions::default(), &())?;
    let read = start.elapsed();
    let points = sample_surface(&mesh, count.parse()?, 1, &())?;
    let sampled = start.elapsed() - read;
    println!(
        "{} points, {} triangles; read in {read:?}, sampled in {sampled:?}",
        mesh.cloud.len(),
        mesh.triangles.len()
    );
    write(&points, &PathBuf::from(output), &())?;
    Ok(())
}
