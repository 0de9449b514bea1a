//! Job files by which engines of farms run the parts of a batch. Nothing runs here.

use std::fmt::Write;

use serde_json::{Value, json};

use super::Job;

/// What runs the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Open Job Description, template version 2023-09 (<https://github.com/OpenJobDescription/openjd-specifications>).
    OpenJd,
    /// A job array of Slurm.
    Slurm,
    /// Ninja: one bake per asset.
    Ninja,
}

/// A batch that is run in parts.
#[derive(Clone, Debug)]
pub struct Farm<'a> {
    /// Arguments of `raykiln batch` with which all parts are run, in any folder.
    pub arguments: Vec<String>,
    /// Arguments of the part that sums up.
    pub collecting: Vec<String>,
    /// Number of parts.
    pub shards: usize,
    /// Memory that a part may take, in bytes.
    pub max_memory: Option<u64>,
    /// The assets.
    pub jobs: &'a [Job],
    /// Arguments of each bake besides its own options.
    pub of_bakes: Vec<String>,
}

/// The program as engines start it.
const PROGRAM: &str = "raykiln";
/// A part succeeds even if assets fail: the part that sums up reports them.
const OF_SHARDS: [&str; 3] = ["--fail-on", "never", "--quiet"];

impl Farm<'_> {
    /// Returns the job file for an engine.
    ///
    /// # Errors
    /// Fails if an argument has characters that the engine would change.
    pub fn job_file(&self, engine: Engine) -> Result<String, String> {
        match engine {
            Engine::OpenJd => self.open_jd(),
            Engine::Slurm => self.slurm(),
            Engine::Ninja => self.ninja(),
        }
    }

    fn open_jd(&self) -> Result<String, String> {
        if let Some(word) = self.arguments.iter().chain(&self.collecting).find(|word| word.contains("{{")) {
            return Err(format!("`{word}`: Open Job Description would replace what is between two braces"));
        }
        let action = |arguments: Vec<String>| json!({"actions": {"onRun": {"command": PROGRAM, "args": arguments}}});
        let batch = |words: &[String], more: &[&str]| -> Vec<String> {
            let more = more.iter().map(|word| (*word).to_owned());
            ["batch".to_owned()].into_iter().chain(words.iter().cloned()).chain(more).collect()
        };
        let shard = format!("{{{{Task.Param.Shard}}}}/{}", self.shards);
        let bake = batch(&self.arguments, &[&OF_SHARDS[..], &["--shard", &shard]].concat());
        let collect = batch(&self.collecting, &["--collect"]);
        let range = format!("1-{}", self.shards);
        let mut step = json!({
            "name": "Bake",
            "parameterSpace": {"taskParameterDefinitions": [{"name": "Shard", "type": "INT", "range": range}]},
            "script": action(bake),
        });
        if let Some(bytes) = self.max_memory {
            let mebibytes = bytes.div_ceil(1 << 20);
            step["hostRequirements"] = json!({"amounts": [{"name": "amount.worker.memory", "min": mebibytes}]});
        }
        let collect = json!({"name": "Collect", "dependencies": [{"dependsOn": "Bake"}], "script": action(collect)});
        let template: Value = json!({
            "specificationVersion": "jobtemplate-2023-09",
            "name": "raykiln batch",
            "steps": [step, collect],
        });
        serde_json::to_string_pretty(&template).map(|text| text + "\n").map_err(|e| e.to_string())
    }

    fn slurm(&self) -> Result<String, String> {
        let memory = self.max_memory.map(|bytes| format!("#SBATCH --mem={}M\n", bytes.div_ceil(1 << 20)));
        let (bake, collect) = (quoted(&self.arguments)?, quoted(&self.collecting)?);
        Ok(format!(
            "#!/bin/sh\n\
             # A job array of Slurm: job=$(sbatch --parsable THIS_FILE). Then, for the summary:\n\
             # sbatch --dependency=afterany:$job --wrap=\"sh THIS_FILE collect\"\n\
             #SBATCH --job-name=raykiln\n\
             #SBATCH --array=1-{shards}\n\
             #SBATCH --requeue\n\
             #SBATCH --open-mode=append\n\
             {memory}\
             if [ \"${{1:-}}\" = collect ]; then\n  \
               exec {PROGRAM} batch {collect} --collect\n\
             fi\n\
             exec {PROGRAM} batch {bake} {of_shards} --threads \"${{SLURM_CPUS_ON_NODE:-1}}\" \
             --shard \"$SLURM_ARRAY_TASK_ID/{shards}\"\n",
            shards = self.shards,
            memory = memory.unwrap_or_default(),
            of_shards = OF_SHARDS.join(" "),
        ))
    }

    /// A bake per asset, so that Ninja bakes what changed; what it bakes is in the cache, from which the summary is made.
    fn ninja(&self) -> Result<String, String> {
        let of_bakes = ninja_text(&quoted(&self.of_bakes)?);
        let collect = ninja_text(&quoted(&self.collecting)?);
        let mut text = format!(
            "ninja_required_version = 1.3\n\n\
             rule bake\n  \
               command = {PROGRAM} bake $options {of_bakes} --quiet --depfile $out.d --output $out -- $in\n  \
               depfile = $out.d\n  deps = gcc\n  description = bake $in\n\n\
             rule summary\n  command = {PROGRAM} batch {collect} --quiet\n  description = summary\n\n"
        );
        let mut outputs = String::new();
        for job in self.jobs {
            let [input, output] = [&job.asset.file, &job.output].map(|path| ninja_path(&path.to_string_lossy()));
            let options = ninja_text(&quoted(&job.settings.words)?);
            let _ = writeln!(text, "build {output}: bake {input}\n  options = {options}");
            let _ = write!(outputs, " {output}");
        }
        let _ = writeln!(text, "\nbuild assets: phony{outputs}\nbuild summary: summary | assets\ndefault assets");
        Ok(text)
    }
}

/// Arguments as a shell reads them.
fn quoted(words: &[String]) -> Result<String, String> {
    if let Some(word) = words.iter().find(|word| word.contains(['\n', '\0'])) {
        return Err(format!("{word:?} has a line break, which a job file cannot hold"));
    }
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_=./,:@%+".contains(c);
    let quote = |word: &String| match word.chars().all(plain) && !word.is_empty() {
        true => word.clone(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    };
    Ok(words.iter().map(quote).collect::<Vec<_>>().join(" "))
}

/// A text in a command of Ninja.
fn ninja_text(text: &str) -> String {
    text.replace('$', "$$")
}

/// A path in a build statement of Ninja.
fn ninja_path(path: &str) -> String {
    path.replace('$', "$$").replace(' ', "$ ").replace(':', "$:")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn farm(words: &[&str]) -> Farm<'static> {
        let arguments: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        let collecting = arguments.clone();
        Farm { arguments, collecting, shards: 3, max_memory: Some(5 << 20), jobs: &[], of_bakes: Vec::new() }
    }

    #[test]
    fn a_shell_reads_what_was_given() {
        let words = ["a b", "it's", "$x", "", "--seed=3"].map(str::to_owned);
        assert_eq!(quoted(&words).expect("one line each"), r"'a b' 'it'\''s' '$x' '' --seed=3");
        assert!(quoted(&["a\nb".to_owned()]).is_err());
    }

    #[test]
    fn a_job_names_its_shards_and_memory() {
        let job = farm(&["in/*.glb", "--out", "out dir"]).job_file(Engine::Slurm).expect("it is written");
        assert!(job.contains("#SBATCH --array=1-3\n") && job.contains("#SBATCH --mem=5M\n"), "{job}");
        assert!(job.contains("'in/*.glb' --out 'out dir' --fail-on never --quiet --threads"), "{job}");
        let job = farm(&["a"]).job_file(Engine::OpenJd).expect("it is written");
        let job: Value = serde_json::from_str(&job).expect("JSON");
        let arguments = &job["steps"][0]["script"]["actions"]["onRun"]["args"];
        assert_eq!(arguments.as_array().and_then(|all| all.last()), Some(&"{{Task.Param.Shard}}/3".into()));
        assert_eq!(job["steps"][0]["hostRequirements"]["amounts"][0]["min"], 5);
    }

    #[test]
    fn what_an_engine_would_change_is_refused() {
        assert!(farm(&["{{Param.X}}"]).job_file(Engine::OpenJd).is_err());
        assert!(farm(&["a\nb"]).job_file(Engine::Ninja).is_err());
        assert_eq!(ninja_path("a b:$c"), "a$ b$:$$c");
    }
}
