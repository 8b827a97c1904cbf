//! Check that two programs are the same build. Plans of another build cannot be decoded, and Ballista 54 treats an
//! executor that cannot decode a plan as broken. So the builds are compared before any plan is sent.

use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use sha2::{Digest as _, Sha256};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

/// HTTP path of the scheduler's build, on its own port.
pub const PATH: &str = "/tauscope/build";

/// Timeout of the answer.
/// Resolution: a scheduler answers in milliseconds.
const PATIENCE: Duration = Duration::from_secs(5);

/// Longest accepted answer \[bytes\].
/// Resolution: bounds memory; an answer has some 200.
const MAX_BYTES: u64 = 4096;

/// Identifier of this build: its versions, and the hash of the program itself.
///
/// # Errors
/// If the program cannot be read.
pub fn build() -> anyhow::Result<String> {
    let program = std::env::current_exe().context("where this program is")?;
    let bytes = std::fs::read(&program).with_context(|| program.display().to_string())?;
    let hash: String = Sha256::digest(&bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let (version, ballista) = (env!("CARGO_PKG_VERSION"), ballista_core::BALLISTA_VERSION);
    Ok(format!(
        "tauscope {version}, ballista {ballista}, program {hash}"
    ))
}

/// Checks that the scheduler at `address` (`host:port`) is this build.
///
/// # Errors
/// If it does not answer, sends no build, or is another build.
pub async fn check(address: &str) -> anyhow::Result<()> {
    let told = tokio::time::timeout(PATIENCE, ask(address)).await;
    let told = told.with_context(|| {
        format!("the scheduler {address} does not answer within {PATIENCE:?}")
    })??;
    let own = build()?;
    ensure!(
        told == own,
        "the scheduler {address} is another build\n  it is   {told}\n  this is {own}\nrun the same program on all machines"
    );
    Ok(())
}

async fn ask(address: &str) -> anyhow::Result<String> {
    let connected = TcpStream::connect(address).await;
    let mut stream = connected.with_context(|| format!("there is no scheduler at {address}"))?;
    let request = format!("GET {PATH} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await?;
    let mut answer = String::new();
    stream
        .take(MAX_BYTES)
        .read_to_string(&mut answer)
        .await
        .context("the scheduler's answer")?;
    match answer.split_once("\r\n\r\n") {
        Some((head, body)) if head.starts_with("HTTP/1.1 200") => Ok(body.trim().to_owned()),
        _ => bail!("what listens at {address} is no scheduler of tauscope"),
    }
}
