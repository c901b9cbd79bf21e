// A host on the emulated USB port: enumerates the device and moves the bytes of its serial port.
//
// The emulator differs from the chip in two ways, which are put right here. Its class answers each request for a packet at
// once, if need be with an empty one; here a request waits until there are bytes. And it takes the mark "available" from a
// buffer when the device offers it, where the chip takes it when the packet has come: a driver that looks at the mark then
// sees the same packet again and again.

const PACKET = 64;
const AVAILABLE = 1 << 10;
const OUT_BUFFER_CONTROL = 0x84;

export function createUsbHost(module, controller, onBytes) {
  const { USBCDC } = module;
  const host = new USBCDC(controller);
  const waiting = [];
  const state = { isOpen: false, wanted: null };
  host.onDeviceConnected = () => {
    state.isOpen = true;
  };
  host.onSerialData = (bytes) => onBytes(bytes);

  function serve() {
    if (state.wanted === null || waiting.length === 0) return;
    const { endpoint, size } = state.wanted;
    state.wanted = null;
    controller.endpointReadDone(endpoint, Uint8Array.from(waiting.splice(0, Math.min(size, PACKET))));
  }

  const mark = (endpoint, isAvailable) => {
    const at = OUT_BUFFER_CONTROL + 8 * endpoint;
    const memory = controller.rp2040.usbDPRAMView;
    const control = memory.getUint32(at, true);
    memory.setUint32(at, isAvailable ? control | AVAILABLE : control & ~AVAILABLE, true);
  };
  const finishRead = controller.finishRead.bind(controller);
  controller.finishRead = (endpoint, bytes) => {
    mark(endpoint, false);
    finishRead(endpoint, bytes);
  };
  controller.onEndpointRead = (endpoint, size) => {
    mark(endpoint, true);
    if (endpoint !== host.outEndpoint) return;
    state.wanted = { endpoint, size };
    serve();
  };
  return {
    get isOpen() {
      return state.isOpen;
    },
    // The cable was out: what was on the way is lost, and the device is reset and enumerated again.
    enumerate() {
      Object.assign(host, { initialized: false, descriptorsSize: null, descriptors: [], inEndpoint: -1, outEndpoint: -1 });
      Object.assign(state, { isOpen: false, wanted: null });
      waiting.length = 0;
      controller.resetDevice();
    },
    send(bytes) {
      waiting.push(...bytes);
      serve();
    },
  };
}
