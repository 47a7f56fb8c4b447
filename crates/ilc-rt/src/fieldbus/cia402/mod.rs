//! CiA 402 drive profile: states, objects, units and the bring-up of a drive.
