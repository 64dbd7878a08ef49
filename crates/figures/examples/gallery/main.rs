//! Draws one figure of each kind with made-up numbers: `cargo run -p figures --example gallery -- FOLDER`.

mod made_up;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1).ok_or("usage: gallery FOLDER")?;
    let folder = std::path::PathBuf::from(folder);
    std::fs::create_dir_all(&folder)?;
    for (name, figure) in made_up::all() {
        let [_, png] = figure.save(&folder.join(name))?;
        println!("{}", png.display());
    }
    Ok(())
}
