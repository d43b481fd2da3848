//! Several hosts on one machine: network namespaces on a bridge, whose cables can be pulled.

use std::{
    net::Ipv4Addr,
    process::{self, Command},
};

use crate::programs::begun_by;

/// Hosts that are joined by a switch; gone when dropped.
#[derive(Debug)]
pub struct Network {
    switch: String,
    hosts: Vec<Host>,
}

/// A host, with a network of its own.
#[derive(Debug)]
pub struct Host {
    name: String,
    namespace: String,
    switch: String,
    address: Ipv4Addr,
}

impl Network {
    /// Makes hosts with these names. `Err` says why this machine cannot have them.
    pub fn of(names: &[&str]) -> Result<Self, String> {
        let switch = format!("gridlight-{}", process::id());
        // What was made is taken down if the rest cannot be.
        let mut network = Self {
            switch: switch.clone(),
            hosts: Vec::new(),
        };
        ip(&format!("netns add {switch}"))?;
        ip(&format!("-n {switch} link add bridge type bridge"))?;
        // A machine that can have these can have the rest.
        let run = |arguments: String| ip(&arguments).expect("hosts can be made");
        run(format!("-n {switch} link set bridge up"));
        for (name, number) in names.iter().zip(1..) {
            let host = Host {
                name: (*name).to_owned(),
                namespace: format!("{switch}-{name}"),
                switch: switch.clone(),
                address: Ipv4Addr::new(10, 77, 0, number),
            };
            let (namespace, address) = (host.namespace.clone(), host.address);
            run(format!("netns add {namespace}"));
            network.hosts.push(host);
            run(format!(
                "-n {switch} link add name to-{name} type veth peer name eth0 netns {namespace}"
            ));
            run(format!("-n {switch} link set to-{name} master bridge up"));
            run(format!("-n {namespace} addr add {address}/24 dev eth0"));
            run(format!("-n {namespace} link set eth0 up"));
            run(format!("-n {namespace} link set lo up"));
        }
        Ok(network)
    }

    /// In the order of their names.
    pub fn hosts(&self) -> &[Host] {
        &self.hosts
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        for namespace in self
            .hosts
            .iter()
            .map(|host| &host.namespace)
            .chain([&self.switch])
        {
            // One that was never made cannot be taken down.
            let _ = ip(&format!("netns del {namespace}"));
        }
    }
}

impl Host {
    /// As it was called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its address in the network.
    pub fn address(&self) -> Ipv4Addr {
        self.address
    }

    /// A command line that is carried out here.
    pub fn command(&self, command: &Command) -> Command {
        begun_by("ip", &["netns", "exec", &self.namespace], command)
    }

    /// Pulls its cable out of the switch: the host itself does not notice.
    pub fn cut(&self) {
        self.switch("nomaster");
    }

    /// Plugs its cable in again.
    pub fn mend(&self) {
        self.switch("master bridge");
    }

    fn switch(&self, state: &str) {
        let switched = ip(&format!("-n {} link set to-{} {state}", self.switch, self.name));
        switched.expect("a link that was made can be switched");
    }
}

/// Runs `ip` with arguments that are separated by spaces.
fn ip(arguments: &str) -> Result<(), String> {
    let output = Command::new("ip").args(arguments.split_whitespace()).output();
    let output = output.map_err(|error| format!("there is no `ip`: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(format!("`ip {arguments}`: {}", said.trim()))
}
