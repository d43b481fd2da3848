//! A grid of three hosts, each with a network of its own: workers with the key wait for their master, lose
//! their cable in mid-frame, and come back.

use std::{net::SocketAddr, thread, time::Duration};

use gridlight::{
    key::KeyFile, master::Master, network::Network, oiio::assert_finite, programs::skipped, worker::Worker,
};
use serde_json::Value;

/// More work than any machine of today does by the deadline.
const ENDLESS: &str = "--size 512x512 --vpls 16384 --vpl-sets 64 --local-slots 0";
const DEADLINE: Duration = Duration::from_secs(14);
/// Longer than a worker waits for a master that says nothing.
const OUTAGE: Duration = Duration::from_secs(2);
/// How often the cable is pulled.
const OUTAGES: u64 = 3;

/// A worker is at work again so soon after its link is back.
const BACK_WITHIN: Duration = Duration::from_secs(1);
/// A worker that has the scene in memory joins and is given work within this time.
const FIRST_TASK_WITHIN_S: f64 = 0.150;

#[test]
fn a_worker_whose_cable_is_pulled_works_again_soon_after_and_the_picture_is_in_time() {
    let network = match Network::of(&["master", "steady", "pulled"]) {
        Ok(network) => network,
        Err(why) => return skipped("three hosts in network namespaces", &why),
    };
    let [master_host, steady_host, pulled_host] = network.hosts() else {
        panic!("three hosts were made");
    };
    let key = KeyFile::make();
    let address = SocketAddr::from((master_host.address(), 7420));

    // The workers are there first, as in a lab, and find the master when it comes.
    let workers = [steady_host, pulled_host].map(|host| Worker::start_on(host, address, 1, key.path()));
    for worker in &workers {
        worker.log.wait_for(&["trying again until a master is there"]);
    }
    let master = Master::new(&format!(
        "--deadline {} {ENDLESS} --listen {address}",
        DEADLINE.as_secs()
    ));
    let master = master.flag("--key", key.path()).on(master_host).start();
    for host in [steady_host, pulled_host] {
        master.log.wait_for(&["a worker joined", host.name()]);
    }
    let mut plugged_in = Vec::new();
    for outage in 0..OUTAGES {
        master.sleep_until(Duration::from_secs(2) + 3 * OUTAGE / 2 * outage as u32);
        pulled_host.cut();
        thread::sleep(OUTAGE);
        pulled_host.mend();
        plugged_in.push(master.age());
    }
    let picture = master.finish();

    picture.assert_in_time(DEADLINE);
    assert_finite(picture.exr());
    assert!(picture.worker("steady")["tasks"].as_u64() > Some(0));
    let all = picture.report("/workers").as_array().expect("a list of workers");
    let visits: Vec<&Value> = all.iter().filter(|worker| worker["name"] == "pulled").collect();
    assert_eq!(visits.len() as u64, 1 + OUTAGES, "{visits:#?}");
    assert!(
        visits.iter().all(|visit| visit["tasks"].as_u64() > Some(0)),
        "{visits:#?}"
    );

    // A machine that is busy with other tests may be late once, but not every time.
    let first_task = |visit: &Value| visit["first_task_s"].as_f64().expect("it was given tasks");
    let back: Vec<f64> = visits[1..]
        .iter()
        .zip(&plugged_in)
        .map(|(visit, plugged_in)| first_task(visit) - plugged_in.as_secs_f64())
        .collect();
    let joining: Vec<f64> = visits[1..]
        .iter()
        .map(|visit| first_task(visit) - visit["joined_s"].as_f64().expect("a time"))
        .collect();
    println!("at work again after {back:.3?} s; {joining:.3?} s from joining to the first task");
    assert!(median(&back) < BACK_WITHIN.as_secs_f64(), "{back:?}");
    assert!(median(&joining) < FIRST_TASK_WITHIN_S, "{joining:?}");
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
