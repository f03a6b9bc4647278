//! Arguments of ROS 2 nodes: `--ros-args -r from:=to -r __node:=name -r __ns:=/boat -p option:=value`.

use std::ffi::OsString;

/// What the words behind `--ros-args` say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// Name of the node.
    pub node: String,
    pub namespace: String,
    /// Other names of topics, as they were written, with the node that a rule is for.
    pub remapped: Vec<(Option<String>, String, String)>,
    /// Options that are switched off.
    pub unset: Vec<String>,
}

impl Default for Names {
    fn default() -> Self {
        Self {
            node: "hydroid".to_owned(),
            namespace: "/".to_owned(),
            remapped: Vec::new(),
            unset: Vec::new(),
        }
    }
}

impl Names {
    /// Separates the words of ROS from those of the program. Parameters become options: `-p max_speed:=2` is
    /// `--max-speed=2`.
    pub fn read(words: impl IntoIterator<Item = OsString>) -> Result<(Self, Vec<OsString>), String> {
        let (mut names, mut own) = (Self::default(), Vec::new());
        let mut words = words.into_iter();
        let mut is_ros = false;
        while let Some(word) = words.next() {
            if word == "--ros-args" {
                is_ros = true;
                continue;
            }
            if !is_ros {
                own.push(word);
                continue;
            }
            let text = word.to_str().ok_or("an argument behind --ros-args is not a text")?;
            let mut value = || {
                let next = words.next().and_then(|next| next.into_string().ok());
                next.ok_or_else(|| format!("{text} needs a value"))
            };
            match text {
                "--" => is_ros = false,
                "-r" | "--remap" => names.remap(&value()?)?,
                "-p" | "--param" => {
                    let given = value()?;
                    let (name, value) = pair(&given)?;
                    match option(name, value)? {
                        Parameter::Option(word) => own.push(word),
                        Parameter::Off(name) => names.unset.push(name),
                    }
                }
                "--log-level" | "--log-config-file" | "--enclave" | "-e" => drop(value()?),
                "--params-file" => {
                    return Err(
                        "--params-file is not read: write the options into the section [live] of the \
                                configuration file, or use -p"
                            .to_owned(),
                    );
                }
                text if text.starts_with("--enable-") || text.starts_with("--disable-") => {}
                other => return Err(format!("'{other}' behind --ros-args is not understood")),
            }
        }
        Ok((names, own))
    }

    fn remap(&mut self, given: &str) -> Result<(), String> {
        let (from, to) = pair(given)?;
        let (node, from) = match from.split_once(':') {
            Some((node, from)) => (Some(node.to_owned()), from),
            None => (None, from),
        };
        match from {
            "__node" | "__name" => to.clone_into(&mut self.node),
            "__ns" => self.namespace = format!("/{}", to.trim_matches('/')),
            _ => self.remapped.push((node, from.to_owned(), to.to_owned())),
        }
        Ok(())
    }

    /// A name with its namespace, before other names count.
    fn full(&self, name: &str) -> String {
        let namespace = self.namespace.trim_end_matches('/');
        if name.starts_with('/') {
            name.to_owned()
        } else if let Some(name) = name.strip_prefix("~/") {
            format!("{namespace}/{}/{name}", self.node)
        } else {
            format!("{namespace}/{name}")
        }
    }

    /// The name of a topic on the network.
    pub fn topic(&self, name: &str) -> String {
        let full = self.full(name);
        let is_own = |node: &Option<String>| node.as_ref().is_none_or(|node| *node == self.node);
        let mut rules = self.remapped.iter().filter(|(node, ..)| is_own(node));
        // The first rule counts.
        let rule = rules.find(|(_, from, _)| self.full(from) == full);
        rule.map_or(full, |(.., to)| self.full(to))
    }
}

fn pair(given: &str) -> Result<(&str, &str), String> {
    given.split_once(":=").ok_or_else(|| format!("'{given}': NAME:=VALUE is needed"))
}

/// What a parameter says about an option.
enum Parameter {
    Option(OsString),
    Off(String),
}

fn option(name: &str, value: &str) -> Result<Parameter, String> {
    let name = name.replace('_', "-");
    match value {
        "true" | "True" if name == "use-sim-time" => {
            Err("use_sim_time: the time of a simulation is not supported".to_owned())
        }
        "true" | "True" => Ok(Parameter::Option(format!("--{name}").into())),
        "false" | "False" => Ok(Parameter::Off(name)),
        value => Ok(Parameter::Option(format!("--{name}={}", value.trim_matches(['"', '\''])).into())),
    }
}
