"""The server of Modbus TCP: input registers that are read and never written."""
