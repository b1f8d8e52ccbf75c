//! The messages on the socket between the program and a process of the sandbox. First the process says that it is
//! ready, and which of its protections the kernel has. Then the program sends one order with the file to decode, and
//! the process one answer.

use std::io::{self, IoSlice, IoSliceMut, Read, Write};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage, SendFlags,
    recvmsg, sendmsg,
};

use super::confine::Layers;

/// The lengths of an order, and what it may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OrderHeader {
    /// Bytes of the head, which follow.
    pub head_bytes: u64,
    /// Bytes of the file, which comes with this message.
    pub file_bytes: u64,
    /// Memory for decoding, bytes.
    pub memory_bytes: u64,
}

/// Bytes of an order's header.
const HEADER_BYTES: usize = 24;

impl OrderHeader {
    fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        for (place, number) in bytes.chunks_exact_mut(8).zip([self.head_bytes, self.file_bytes, self.memory_bytes]) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        bytes
    }

    fn from_bytes(bytes: [u8; HEADER_BYTES]) -> Self {
        let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
        Self { head_bytes: number(0), file_bytes: number(8), memory_bytes: number(16) }
    }
}

/// Sends an order with its file.
pub fn send_order(socket: impl AsFd, header: OrderHeader, file: BorrowedFd<'_>) -> io::Result<()> {
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut control = SendAncillaryBuffer::new(&mut space);
    let files = [file];
    control.push(SendAncillaryMessage::ScmRights(&files));
    let sent = sendmsg(socket, &[IoSlice::new(&header.to_bytes())], &mut control, SendFlags::NOSIGNAL)?;
    if sent == HEADER_BYTES { Ok(()) } else { Err(io::ErrorKind::WriteZero.into()) }
}

/// Receives an order. None if the program has ended.
pub fn receive_order(socket: impl AsFd) -> io::Result<Option<(OrderHeader, OwnedFd)>> {
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut control = RecvAncillaryBuffer::new(&mut space);
    let mut bytes = [0; HEADER_BYTES];
    let received = recvmsg(socket, &mut [IoSliceMut::new(&mut bytes)], &mut control, RecvFlags::CMSG_CLOEXEC)?;
    let file = control.drain().find_map(|message| match message {
        RecvAncillaryMessage::ScmRights(mut files) => files.next(),
        _ => None,
    });
    match (received.bytes, file) {
        (HEADER_BYTES, Some(file)) => Ok(Some((OrderHeader::from_bytes(bytes), file))),
        (0, _) => Ok(None),
        _ => Err(io::ErrorKind::InvalidData.into()),
    }
}

/// Sends an answer.
pub fn send_answer(socket: &mut impl Write, answer: &[u8]) -> io::Result<()> {
    socket.write_all(&(answer.len() as u64).to_le_bytes())?;
    socket.write_all(answer)
}

/// Says that the process is ready, and what the kernel refuses it.
pub fn send_ready(socket: &mut impl Write, layers: Layers) -> io::Result<()> {
    socket.write_all(&[1 | u8::from(layers.has_landlock) << 1 | u8::from(layers.has_seccomp) << 2])
}

/// Waits until the process is ready.
pub fn receive_ready(socket: &mut impl Read) -> io::Result<Layers> {
    let mut byte = [0];
    socket.read_exact(&mut byte)?;
    Ok(Layers { has_landlock: byte[0] & 2 != 0, has_seccomp: byte[0] & 4 != 0 })
}
