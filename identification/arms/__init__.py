"""Recordings of an arm, fixed, floating or suspended, by the torques of its joints."""
