//! UART 0 of ARM's MPS2 boards (the CMSDK APB UART), polled: the knob box on one side, the answers on the other.

use core::fmt;
use core::ptr;

const BASE: usize = 0x4000_4000;
const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CONTROL: usize = 0x08;
const BAUD_DIVIDER: usize = 0x10;

const STATE_TRANSMIT_FULL: u32 = 1 << 0;
const STATE_RECEIVE_FULL: u32 = 1 << 1;
const CONTROL_BOTH_ON: u32 = 0b11;
/// 25 MHz over this is 115,200 baud.
const DIVIDER: u32 = 217;

/// The one UART; the program makes one and keeps it.
pub struct Uart(());

impl Uart {
    /// Switches it on.
    pub fn start() -> Self {
        write(BAUD_DIVIDER, DIVIDER);
        write(CONTROL, CONTROL_BOTH_ON);
        Self(())
    }

    /// Waits for the next byte.
    pub fn receive(&mut self) -> u8 {
        while read(STATE) & STATE_RECEIVE_FULL == 0 {}
        read(DATA) as u8
    }

    fn send(&mut self, byte: u8) {
        while read(STATE) & STATE_TRANSMIT_FULL != 0 {}
        write(DATA, byte.into());
    }
}

impl fmt::Write for Uart {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.bytes().for_each(|byte| self.send(byte));
        Ok(())
    }
}

fn read(register: usize) -> u32 {
    // SAFETY: a register of the UART, which the board has at this address.
    unsafe { ptr::read_volatile(ptr::with_exposed_provenance(BASE + register)) }
}

fn write(register: usize, value: u32) {
    // SAFETY: as in `read`; no register of the UART reaches memory.
    unsafe { ptr::write_volatile(ptr::with_exposed_provenance_mut(BASE + register), value) }
}
