//! A ROS 2 machine for tests of `motorlink node --ros2`. It prints JSON.
//!
//! `ros2-peer ADDRESS graph | states TOPIC | diagnostics | velocity TOPIC JOINT RAD_PER_S SECONDS | call SERVICE`

use std::time::{Duration, Instant};

use hiroz::context::{ZContext, ZContextBuilder};
use hiroz::{Builder, Result};
use hiroz_msgs::diagnostic_msgs::DiagnosticArray;
use hiroz_msgs::sensor_msgs::JointState;
use hiroz_msgs::std_srvs::TriggerRequest;
use hiroz_msgs::std_srvs::srv::Trigger;
use serde_json::{Value, json};

/// The time for discovery, and for an answer.
const PATIENCE: Duration = Duration::from_secs(10);
const PERIOD: Duration = Duration::from_millis(20);

#[tokio::main]
async fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let [address, action @ ..] = &words[..] else { return Err("ADDRESS is missing".into()) };
    let context = ZContextBuilder::default().with_mode("client").with_connect_endpoints([*address]);
    let context = context.build()?;
    let printed = match action {
        ["graph"] => graph(&context).await,
        ["states", topic] => states(&context, topic).await?,
        ["diagnostics"] => diagnostics(&context).await?,
        ["velocity", topic, joint, value, seconds] => {
            let (value, seconds) = (value.parse()?, Duration::from_secs_f64(seconds.parse()?));
            velocity(&context, topic, joint, value, seconds).await?
        }
        ["call", service] => call(&context, service).await?,
        _ => return Err("the action is not known".into()),
    };
    println!("{printed}");
    context.shutdown()
}

async fn graph(context: &ZContext) -> Value {
    tokio::time::sleep(Duration::from_secs(1)).await;
    let graph = context.graph();
    json!({
        "nodes": graph.get_node_names(),
        "topics": graph.get_topic_names_and_types(),
        "services": graph.get_service_names_and_types(),
    })
}

async fn states(context: &ZContext, topic: &str) -> Result<Value> {
    let node = context.create_node("looks").build()?;
    let subscriber = node.create_sub::<JointState>(topic).build()?;
    let state = tokio::time::timeout(PATIENCE, subscriber.async_recv()).await??;
    let stamp = &state.header.stamp;
    Ok(json!({
        "stamp": f64::from(stamp.sec) + f64::from(stamp.nanosec) / 1e9,
        "name": state.name,
        "position": state.position.to_vec(),
        "velocity": state.velocity.to_vec(),
        "effort": state.effort.to_vec(),
    }))
}

async fn diagnostics(context: &ZContext) -> Result<Value> {
    let node = context.create_node("looks").build()?;
    let subscriber = node.create_sub::<DiagnosticArray>("/diagnostics").build()?;
    let array = tokio::time::timeout(PATIENCE, subscriber.async_recv()).await??;
    let status = array.status.iter().map(|status| {
        let values = status.values.iter().map(|it| (it.key.clone(), Value::from(it.value.clone())));
        json!({
            "level": status.level,
            "name": status.name,
            "message": status.message,
            "hardware_id": status.hardware_id,
            "values": Value::Object(values.collect()),
        })
    });
    Ok(status.collect())
}

async fn velocity(
    context: &ZContext,
    topic: &str,
    joint: &str,
    value: f64,
    time: Duration,
) -> Result<Value> {
    let node = context.create_node("commands").build()?;
    let publisher = node.create_pub::<JointState>(topic).build()?;
    let mut command = JointState { name: vec![joint.to_owned()], ..JointState::default() };
    command.velocity = vec![value];
    let (end, mut sent) = (Instant::now() + time, 0);
    while Instant::now() < end {
        publisher.async_publish(&command).await?;
        sent += 1;
        tokio::time::sleep(PERIOD).await;
    }
    Ok(json!({ "sent": sent }))
}

async fn call(context: &ZContext, service: &str) -> Result<Value> {
    let node = context.create_node("calls").build()?;
    let client = node.create_client::<Trigger>(service).build()?;
    let response = client.call_with_timeout(&TriggerRequest::default(), PATIENCE).await?;
    Ok(json!({ "success": response.success, "message": response.message }))
}
